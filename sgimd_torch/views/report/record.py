"""The record in a report: doubts, what differs between configurations, versions, and how to repeat the runs.

doubts(variants)    # ["1 run not finished: ..."];   commands(variant.lives)    # ["sgimd run --algorithm=sgim-d ..."]
"""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from sgimd_torch.runs.config import PLACE, Config, words
from sgimd_torch.runs.directory import FORWARD
from sgimd_torch.views.report.data import Life, Variant

AGAIN: Final = "runs/again"  # a folder that holds no run yet


class Table(NamedTuple):
    """The ``head`` of the columns after the first; ``rows`` of a name and a cell for each of them."""

    head: list[str]
    rows: list[tuple[str, list[str]]]


def doubts(variants: Sequence[Variant]) -> Iterator[str]:
    """What a reader should know before comparing these runs, a sentence each."""
    lives = [(variant.label, life) for variant in variants for life in variant.lives]
    versions = [life.versions for _, life in lives]
    for name in dict.fromkeys(name for each in versions for name in each if name not in ("before", "platform")):
        asked = [each for each in versions if name in each or name not in FORWARD]
        values = list(dict.fromkeys(str(each.get(name)) for each in asked))
        if len(values) > 1:
            yield f"The runs were made with different versions of {name}: {', '.join(values)}."
    if dirty := sum(str(each.get("commit")).endswith("-dirty") for each in versions):
        yield f"{count(dirty, 'run')} came from a checkout with uncommitted changes; the commit does not show them."
    if nowhere := sum(each.get("commit") is None for each in versions):
        yield f"The commit of {count(nowhere, 'run')} is not known: made outside a git checkout."
    if resumed := sum(bool(each.get("before")) for each in versions):
        yield f"{count(resumed, 'run')} went on with other versions than at the start."
    for variant in variants:
        own = differing([variant])
        if own.pop("movements", None):
            lengths = ", ".join(map(str, sorted({life.config["movements"] for life in variant.lives})))
            yield f"The runs of {variant.label} are not equally long: {lengths} movements."
        if own:
            yield f"The seeds of {variant.label} have different configurations: they differ in {', '.join(own)}."
    lasts = sorted({variant.last for variant in variants if variant.last})
    if len(lasts) > 1:
        yield f"Last errors are of different numbers of movements: after {', '.join(map(str, lasts))} movements."
    if len({life.config.get("benchmark_crc32") for _, life in lives}) > 1:
        yield "The runs were evaluated on different benchmarks, so their errors cannot be compared."
    for label, life in lives:
        if life.damage:
            yield f"{label}, seed {life.seed}: {life.state}; its errors are left out, maps show what precedes it."
    cut = [
        f"{of}, seed {life.seed}: {len(life.index)} of {life.config['movements']} movements"
        for of, life in lives
        if life.state == "not finished"
    ]
    if cut:
        some = any(variant.used and variant.used[0].state == "finished" for variant in variants)
        rest = "; maps show them, errors over seeds leave them out" if some else ""
        yield f"{count(len(cut), 'run')} not finished, stopped or still running{rest}: {'; '.join(cut)}."


def by_context(variants: Sequence[Variant]) -> Table:
    """The last error (m) in each part of C, the mean over seeds, of the variants that have contexts."""
    found = [(v.label, [life.in_contexts(v.last) for life in v.used]) for v in variants]
    parts = list(dict.fromkeys(part for _, lives in found for life in lives for part in life))
    rows = []
    for label, lives in found:
        means = [np.mean([life.get(part, np.nan) for life in lives]) for part in parts]
        if any(lives):
            rows.append((label, [f"{mean:.3f}" if np.isfinite(mean) else "–" for mean in means]))
    return Table(parts, rows)


def versions(variants: Sequence[Variant]) -> Table:
    """A column for each set of versions, headed by its variants; a row for each library, the commit first."""
    made: dict[str, Counter[str]] = {}
    for variant in variants:
        for life in variant.lives:
            made.setdefault(json.dumps(life.versions, sort_keys=True), Counter())[variant.label] += 1
    every = [json.loads(text) for text in made]
    names = sorted({name for each in every for name in each}, key=lambda name: (name != "commit", name))
    heads = []
    for counts in made.values():
        each = ", ".join(f"{label} ({n})" for label, n in counts.items())
        heads.append(
            f"all {len(counts)} variants ({counts.total()} runs)" if len(counts) == len(variants) > 3 else each
        )
    return Table(heads, [(name, [_shown(each.get(name)) for each in every]) for name in names])


def checkout(variants: Sequence[Variant]) -> str:
    """The command that checks out the commit of all runs; "" if they differ, or it had uncommitted changes."""
    commits = {str(life.versions.get("commit")) for variant in variants for life in variant.lives}
    name = commits.pop() if len(commits) == 1 else "None"
    return "" if name == "None" or name.endswith("-dirty") else shlex.join(["git", "checkout", name])


def commands(lives: Sequence[Life]) -> list[str]:
    """A line of shell for each configuration of these runs, nearly always one; defaults are left out."""
    groups: dict[str, list[int]] = {}
    for life in lives:
        own = {name: value for name, value in life.config.items() if name == "name" or name not in PLACE}
        if own.get("name") == own["algorithm"]:
            del own["name"]  # a run is named after its algorithm anyway
        groups.setdefault(shlex.join(words(Config.from_settings(own))), []).append(life.seed)
    lines = []
    for given, seeds in groups.items():
        line = f"sgimd run {given} --seed={'$seed' if len(seeds) > 1 else seeds[0]} --out={AGAIN}"
        lines.append(f"for seed in {' '.join(map(str, seeds))}; do\n  {line}\ndone" if len(seeds) > 1 else line)
    return lines


def differing(variants: Sequence[Variant]) -> dict[str, list[str]]:
    """Option -> for each variant its values as text, for options in which runs differ, without seed and place."""
    every = [life.config for variant in variants for life in variant.lives]
    found = {}
    for name in dict.fromkeys(name for config in every for name in config if name not in PLACE):
        values = [dict.fromkeys(_shown(life.config.get(name)) for life in variant.lives) for variant in variants]
        if len(set().union(*values)) > 1:
            found[name] = [" or ".join(each) for each in values]
    return found


def count(n: int, what: str) -> str:
    """``1 seed``, ``2 seeds``."""
    return f"{n} {what}{'s' * (n != 1)}"


def _shown(value: Any) -> str:
    return "–" if value is None else value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
