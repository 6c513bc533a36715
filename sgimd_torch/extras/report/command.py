"""Write one page about one run, or about many runs side by side: a single file that opens without network.

The page shows error curves with intervals over seeds, outcomes, errors by goal, found and expected, and the interest
map. It has tables of results, settings and versions, and the commands that repeat each run. It lists unfinished runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgimd_torch.evaluation import RECENT
from sgimd_torch.extras.report import figures, provenance
from sgimd_torch.extras.table.results import results
from sgimd_torch.extras.table.statistics import LEAST_SEEDS, Interval, interval_text
from sgimd_torch.extras.table.variants import Variant, baseline_of, best_first, compare, read_runs, unit_of
from sgimd_torch.files import check_writable, write_text
from sgimd_torch.record import RunError
from sgimd_torch.runs.program import parser_of

EXAMPLES = """examples:
  sgimd report runs/sgim-d/seed-003               one run, into runs/sgim-d/seed-003/report.html
  sgimd report runs/sgim-d                        all seeds of a variant
  sgimd report runs --out paper.html              every variant in runs, compared
  sgimd report runs --baseline sagg-riac          differences from sagg-riac
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page, print its path, and return the exit code 0.

    Raises:
        ValueError: there are no runs, or a run is damaged.
        OSError: a file cannot be read or written.
    """
    options = parser().parse_args(argv)
    out = options.out or options.runs / "report.html"
    if options.out is not None and (out.is_dir() or not out.parent.is_dir()):  # before any work
        raise RunError(f"--out must be a file in a folder that exists, got {out}")
    variants = best_first(Variant(name, runs) for name, runs in read_runs(options.runs).items())
    check_writable(out)
    write_text(out, page(options.runs, variants, options.baseline))
    print(out)
    return 0


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd report``."""
    parser = parser_of("report", __doc__, epilog=EXAMPLES)
    parser.add_argument("runs", type=Path, help="folder of a run, of a variant or of variants")
    parser.add_argument("--out", type=Path, metavar="FILE", help="page to write (default: RUNS/report.html)")
    parser.add_argument("--baseline", metavar="NAME", help="variant to compare the others with, seed by seed")
    return parser


def page(folder: Path, variants: Sequence[Variant], baseline: str | None = None) -> str:
    """The page as HTML: ``template.html.j2``, filled with figures and numbers of each variant; texts are escaped.

    Args:
        folder: folder of the runs.
        variants: variants in the order of the page, at least one.
        baseline: name of the variant to compare the others with; None for the default of `baseline_of`.

    Raises:
        ValueError: ``baseline`` is no variant that was evaluated.
    """
    reference = baseline_of(variants, baseline)
    runs = [run for variant in variants for run in variant.runs]
    return rendered(
        Path(__file__).with_name("template.html.j2"),
        folder=folder,
        variants=variants,
        single=runs[0] if len(runs) == 1 else None,
        n_runs=len(runs),
        warnings=list(provenance.warnings(variants)),
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


def rendered(template: Path, **values: Any) -> str:
    """A template as HTML, filled with values; their texts are escaped. It may include parts from this folder."""
    loader = FileSystemLoader([template.parent, Path(__file__).parent])
    jinja = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    jinja.filters |= {"interval": _interval}
    html = jinja.get_template(template.name).render(**values)
    return html.encode(errors="backslashreplace").decode()  # a name may hold invalid characters


def _interval(number: Interval | None, form: str = ".3f") -> str:
    """``0.060 [0.058, 0.062]``, or a dash for None."""
    return "–" if number is None else interval_text(number, form)
