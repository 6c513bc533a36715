"""Provenance of the runs of a report: warnings, differing settings, versions, and commands that repeat the runs.

warnings(variants)    # ["1 run not finished: ..."];   commands(variant.runs)    # ["sgimd run --algorithm=sgim-d ..."]
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Final

from sgimd_torch.extras.table.statistics import LEAST_SEEDS
from sgimd_torch.extras.table.variants import Variant, differing, text_of, unalike
from sgimd_torch.runs.messages import printable
from sgimd_torch.runs.read import Run

AGAIN: Final = "runs/again"  # folder for the repeated runs


def warnings(variants: Sequence[Variant]) -> Iterator[str]:
    """Warnings for a reader who wants to compare these runs, one sentence each."""
    every = [run for variant in variants for run in variant.runs]
    few = [f"{variant.label} ({len(variant.used)})" for variant in variants if 0 < len(variant.used) < LEAST_SEEDS]
    if few and len(every) > 1:
        yield f"Fewer than {LEAST_SEEDS} seeds: {', '.join(few)}. They have points, but no intervals and no verdict."
    yield from (f"{line}." for line in unalike(variants))
    if len({run.files.get("benchmark_crc32") for run in every}) > 1:
        yield "The runs were evaluated on different benchmarks, so their errors cannot be compared."
    for name, values in versions(variants).items():
        if len(values) > 1 and name != "platform":
            yield f"The runs were made with different versions of {name}: {', '.join(values)}."
    if dirty := sum(str(run.versions.get("commit")).endswith("-dirty") for run in every):
        yield f"{_count(dirty)} came from a checkout with uncommitted changes, which the commit lacks."
    for variant in variants:
        if own := differing([variant]):
            yield f"The seeds of {variant.label} have different settings: they differ in {', '.join(own)}."
    lasts = sorted({variant.compared_at for variant in variants if variant.compared_at})
    if len(lasts) > 1:
        yield f"The last errors belong to different numbers of movements: {', '.join(map(str, lasts))}."
    for run in every:
        yield from (f"{run.path}: {remark}.".replace("?.", "?") for remark in (*run.changes, *run.remarks))
    cut = [run for run in every if not run.summary["finished"]]
    if cut:
        named = [f"{run.path}: {len(run.index)} of {run.config['movements']} movements" for run in cut]
        yield f"{_count(len(cut))} not finished, stopped or still running: {'; '.join(named)}."


def versions(variants: Sequence[Variant]) -> dict[str, dict[str, None]]:
    """Versions by name, the commit first; of a resumed run, also the versions before it was resumed."""
    values_of: dict[str, dict[str, None]] = {"commit": {}}
    for run in [run for variant in variants for run in variant.runs]:
        for made_by in (run.versions, *run.versions.get("before", ())):
            for name, value in made_by.items():
                if name != "before":
                    values_of.setdefault(name, {})[text_of(value)] = None
    return values_of


def commands(runs: Sequence[Run]) -> list[str]:
    """Shell commands that repeat the runs, one for all seeds with equal settings. Default options are left out."""
    groups: dict[str, list[int]] = {}
    for run in runs:
        own = [word for word in run.words if word.partition("=")[0] not in ("--seed", "--out", "--board")]
        groups.setdefault(printable(shlex.join(own)), []).append(int(run.config["seed"]))
    lines = list[str]()
    for given, seeds in groups.items():
        line = f"sgimd run {given} --seed={'$seed' if len(seeds) > 1 else seeds[0]} --out={AGAIN}"
        lines.append(f"for seed in {' '.join(map(str, seeds))}; do\n  {line}\ndone" if len(seeds) > 1 else line)
    return lines


def _count(n: int) -> str:
    return f"{n} run{'s' * (n != 1)}"
