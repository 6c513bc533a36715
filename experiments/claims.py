"""Tables and verdicts of results/RESULTS.md, computed from results/paper.csv; the prose around them stays as it is.

Each table replaces what stands between its two marker lines:

  <!-- claims -->     the paper's claims, each with its bar, our number and a verdict      <!-- end of claims -->
  <!-- learners -->   the five learners: errors, mean over life, improvement, tiles        <!-- end of learners -->
  <!-- ablations -->  the same of all other variants                                       <!-- end of ablations -->

Intervals are bootstrapped with a fixed seed, so that the same results give the same file. Where results/goals.csv
(variant,seed,n_goals,n_near) lies beside the results, the claim on goals in the large space is judged from it.

Example:
  python experiments/claims.py --results results/paper.csv --out results/RESULTS.md
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import numpy as np

from evidence import Evidence, NotRun, metres, rng, shared, show
from judgements import Row, judge
from over_seeds import difference_interval, improvement_interval, iqm_interval, mean_over_life
from read_results import LAST, Evaluated, ResultsError, read_goals, read_results
from runfiles import make_folder, write_whole
from sgimd_torch.spaces import Array
from supervise import with_streams

EMPTY = """# Results

Numbers are interquartile means over seeds, in brackets their 95 % bootstrap intervals, in metres unless they say
otherwise. `experiments/claims.py` writes the tables; `experiments/over_seeds.py` explains the statistics.

## The paper's claims

<!-- claims -->
<!-- end of claims -->

## The five learners

<!-- learners -->
<!-- end of learners -->

## Ablations, rivals and other teaching

<!-- ablations -->
<!-- end of ablations -->
"""
COLUMNS = (
    *("experiment", "variant", "seeds", "error at 1000 (m)", "error at 5000 (m)", "mean over life (m)"),
    *("SGIM-D better, probability", "difference to SGIM-D (m)", "tiles reached"),
)


def claims_table(rows: Sequence[Row]) -> str:
    """The claims in markdown."""
    cells = [(row.claim, row.bar, row.number, f"**{row.verdict}**") for row in rows]
    return markdown(("claim of the paper", "bar", "our number [95 % interval]", "verdict"), cells)


def variants_table(variants: Sequence[Evaluated], evidence: Evidence) -> str:
    """One line for each variant: how it did, and how SGIM-D did beside it, at 5000 movements unless told otherwise.

    A difference is that of the variant to SGIM-D, above 0 where SGIM-D is better, on the seeds that both have.
    """
    return markdown(COLUMNS, [_line(variant.variant, evidence) for variant in variants])


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table; one without lines says so."""
    if not lines:
        return "Not run.\n"
    rows = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in line] for line in lines)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def between_markers(text: str, name: str, table: str, path: Path) -> str:
    """``text`` with ``table`` in the place called ``name``.

    Raises:
        ResultsError: the place is not marked, or marked more than once.
    """
    first, last = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    if text.count(first) != 1 or text.count(last) != 1 or text.index(first) > text.index(last):
        raise ResultsError(
            f"{path} must hold the line {first.strip()} and below it the line {last}, each once; "
            "mark where that table is to stand, or move the file away to get a new one"
        )
    before, after = text[: text.index(first) + len(first)], text[text.index(last) :]
    return f"{before}\n{table}\n{after}"


def _line(name: str, evidence: Evidence) -> list[str]:
    at_the_end = evidence.results[name].at(LAST)

    def told(tell: Callable[[], str]) -> str:
        try:
            return tell()
        except NotRun:
            return "-"

    def improvement() -> str:
        return show(improvement_interval(evidence.errors("sgim-d"), evidence.errors(name), rng=rng()))

    def difference() -> str:
        pairs = shared(evidence.at(name), evidence.at("sgim-d"))
        few = f" ({len(pairs[0])} pairs)" if len(pairs[0]) < len(at_the_end) else ""
        return metres(difference_interval(*pairs, rng=rng())).removesuffix(" m") + few

    def iqm(values: Callable[[], Array], form: str) -> str:
        return told(lambda: show(iqm_interval(values(), rng=rng()), form))

    itself = name == "sgim-d"
    return [
        evidence.results[name].experiment,
        name,
        str(len(at_the_end)),
        iqm(lambda: evidence.errors(name, 1000), ".3f"),
        iqm(lambda: evidence.errors(name), ".3f"),
        iqm(lambda: mean_over_life(*evidence.curves(name)), ".3f"),
        "" if itself else told(improvement),
        "" if itself else told(difference),
        iqm(lambda: np.array(list(evidence.at(name, values="tiles").values())), ".0f"),
    ]


def tables(rows: Sequence[Row], evidence: Evidence) -> dict[str, str]:
    """The three tables by the names of their places; learners from the worst to the best."""
    variants = evidence.results.values()
    learners = sorted((v for v in variants if v.experiment == "learners"), key=lambda v: -_mean_error(v))
    others = [variant for variant in variants if variant.experiment != "learners"]
    return {
        "claims": claims_table(rows),
        "learners": variants_table(learners, evidence),
        "ablations": variants_table(others, evidence),
    }


def _mean_error(variant: Evaluated) -> float:
    """At the end; inf where it was never evaluated there."""
    return float(np.mean(list(variant.at(LAST).values()) or [np.inf]))


def main(argv: Sequence[str] | None = None) -> int:
    """Write the tables; the exit code is 2 when the results or the file make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results/paper.csv"), help="default: %(default)s")
    parser.add_argument("--out", type=Path, default=Path("results/RESULTS.md"), help="default: %(default)s")
    options = parser.parse_args(argv)
    try:
        evidence = Evidence(read_results(options.results), read_goals(options.results.with_name("goals.csv")))
        rows = judge(evidence)
        text = options.out.read_text(encoding="utf-8") if options.out.exists() else EMPTY
        for name, table in tables(rows, evidence).items():
            text = between_markers(text, name, table, options.out)
        make_folder(options.out.parent)
        write_whole(options.out, text)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"error: {options.out} cannot be read or written: {error.strerror}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    verdicts = [row.verdict for row in rows]
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in dict.fromkeys(verdicts))
    print(f"{options.out}: {len(verdicts)} claims, of which {counts}")
    return 0


if __name__ == "__main__":
    sys.exit(with_streams(main))
