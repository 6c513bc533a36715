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
from pages import count_verdicts, markdown, read_page, verdicts_table, write_page
from read_results import LAST, Evaluated, read_goals, read_results
from sgimd_torch.runs.process import telling_errors, with_streams
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import difference_interval, improvement_interval, iqm_interval, mean_over_life

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


def variants_table(variants: Sequence[Evaluated], evidence: Evidence) -> str:
    """One line for each variant: how it did, and how SGIM-D did beside it, at 5000 movements unless told otherwise.

    A difference is that of the variant to SGIM-D, above 0 where SGIM-D is better, on the seeds that both have.
    """
    return markdown(COLUMNS, [_line(variant.variant, evidence) for variant in variants])


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
        "claims": verdicts_table("claim of the paper", rows),
        "learners": variants_table(learners, evidence),
        "ablations": variants_table(others, evidence),
    }


def _mean_error(variant: Evaluated) -> float:
    """At the end; inf where it was never evaluated there."""
    return float(np.mean(list(variant.at(LAST).values()) or [np.inf]))


@telling_errors
def main(argv: Sequence[str] | None = None) -> int:
    """Write the tables; the exit code is 2 when the results or the file make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results/paper.csv"), help="default: %(default)s")
    parser.add_argument("--out", type=Path, default=Path("results/RESULTS.md"), help="default: %(default)s")
    options = parser.parse_args(argv)
    evidence = Evidence(read_results(options.results), read_goals(options.results.with_name("goals.csv")))
    rows = judge(evidence)
    write_page(options.out, read_page(options.out, EMPTY), tables(rows, evidence))
    print(f"{options.out}: {len(rows)} claims, of which {count_verdicts(rows)}")
    return 0


if __name__ == "__main__":
    sys.exit(with_streams(main))
