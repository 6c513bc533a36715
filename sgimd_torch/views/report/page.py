"""The page of a report: figures and numbers of each variant go into template.html.j2, as one file.

html = page(Path("runs"), variants)    # from data.read; strings from runs are escaped
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgimd_torch.views import comparison
from sgimd_torch.views.report import figures, record
from sgimd_torch.views.statistics import LEAST_SEEDS, Interval, show
from sgimd_torch.views.variants import Variant, unit_of

EARLY: Final = 1000  # movements, for the column next to the last error


def page(place: Path, variants: Sequence[Variant], baseline: str | None = None) -> str:
    """The page.

    Args:
        place: where the runs were found.
        variants: the best first, not empty.
        baseline: name of the variant that the others are compared with; see `comparison.baseline_of`.

    Raises:
        ValueError: the baseline is no variant with errors.
    """
    reference = comparison.baseline_of(variants, baseline)
    runs = [run for variant in variants for run in variant.runs]
    jinja = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    jinja.filters |= {
        "interval": _interval,
        "number": lambda value, digits: f"{value:.{digits}f}" if np.isfinite(value) else "–",
    }
    html = jinja.get_template("template.html.j2").render(
        place=place,
        variants=variants,
        single=runs[0] if len(runs) == 1 else None,
        n_runs=len(runs),
        warnings=list(record.doubts(variants)),
        baseline=reference,
        compared=comparison.compare(variants, reference),
        colours=figures.colours_of(variants),
        planes=figures.planes_of(variants),
        early=EARLY,
        least_seeds=LEAST_SEEDS,
        figures=figures,
        record=record,
        unit=unit_of(variants),
    )
    return html.encode(errors="backslashreplace").decode()  # a name may not be valid text


def _interval(found: Interval | None, form: str = ".3f") -> str:
    """``0.060 [0.058, 0.062]``, a dash for nothing."""
    return "–" if found is None else show(found, form)
