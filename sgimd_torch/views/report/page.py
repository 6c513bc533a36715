"""The page of a report: ``template.html.j2``, filled with figures and numbers of each variant.

html = page(Path("runs"), variants)    # variants come from best_first; text from runs is escaped
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgimd_torch.evaluation import RECENT
from sgimd_torch.views.report import figures, provenance
from sgimd_torch.views.results import results
from sgimd_torch.views.statistics import LEAST_SEEDS, Interval, show
from sgimd_torch.views.variants import Variant, baseline_of, compare, unit_of


def page(place: Path, variants: Sequence[Variant], baseline: str | None = None) -> str:
    """The page as HTML.

    Args:
        place: folder of the runs.
        variants: variants in the order of the page, at least one.
        baseline: name of the variant to compare the others with; None for the default of `baseline_of`.

    Raises:
        ValueError: ``baseline`` is no variant that was evaluated.
    """
    reference = baseline_of(variants, baseline)
    runs = [run for variant in variants for run in variant.runs]
    jinja = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    jinja.filters |= {"interval": _interval}
    html = jinja.get_template("template.html.j2").render(
        place=place,
        variants=variants,
        single=runs[0] if len(runs) == 1 else None,
        n_runs=len(runs),
        warnings=list(provenance.doubts(variants)),
        baseline=reference,
        compared=compare(variants, reference),
        colours=figures.colours_of(variants),
        planes=figures.planes_of(variants),
        results=results(variants),
        recent=RECENT,
        least_seeds=LEAST_SEEDS,
        figures=figures,
        provenance=provenance,
        unit=unit_of(variants),
    )
    return html.encode(errors="backslashreplace").decode()  # a name may hold invalid characters


def _interval(found: Interval | None, form: str = ".3f") -> str:
    """``0.060 [0.058, 0.062]``, or a dash for None."""
    return "–" if found is None else show(found, form)
