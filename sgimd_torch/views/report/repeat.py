"""What made the runs of a report, and how to make them again: versions, doubts about them, and command lines.

print(command(variant.lives))    # for seed in 0 1 2; do python experiments/run.py --algorithm=sgim-d ...; done
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from sgimd_torch.runs.config import Config
from sgimd_torch.views.report.data import Life, Variant, differing

AGAIN = "runs/again"  # a folder that holds no run yet


def commands(lives: Sequence[Life]) -> list[str]:
    """A line of shell for each way in which these runs were configured, nearly always one."""
    groups: dict[str, list[int]] = {}
    for life in lives:
        groups.setdefault(shlex.join(options(life.config)), []).append(life.seed)
    return [_line(words, seeds) for words, seeds in groups.items()]


def options(config: Mapping[str, Any]) -> list[str]:
    """Of ``run.py``: those that differ from its defaults, without seed and place."""
    given = []
    for field in fields(Config):
        value = config.get(field.name, field.default)
        default = json.loads(json.dumps(field.default, default=str))
        if field.name not in ("seed", "out", "threads", "board") and value != default:
            told = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
            given.append(f"--{field.name}={told}")
    algorithm = config["algorithm"]
    return [f"--algorithm={algorithm}", *(word for word in given if word not in _needless(algorithm))]


def unknown(lives: Sequence[Life]) -> list[str]:
    """Options of the runs that ``run.py`` does not have here: a command cannot name them."""
    known = {field.name for field in fields(Config)}
    names = {name for life in lives for name in life.config if not name.endswith("_crc32")}
    return sorted(names - known)


def doubts(variants: Sequence[Variant]) -> list[str]:
    """What a reader should know before comparing these runs."""
    lives = [life for variant in variants for life in variant.lives]
    found = []
    for name, values in disagreeing(lives).items():
        if name != "platform":
            found.append(f"The runs were made with different versions of {name}: {', '.join(map(str, values))}.")
    if any(str(life.versions.get("commit")).endswith("-dirty") for life in lives):
        dirty = sum(str(life.versions.get("commit")).endswith("-dirty") for life in lives)
        found.append(f"{_runs(dirty)} came from a checkout with uncommitted changes; the commit does not tell them.")
    nowhere = sum(life.versions.get("commit") is None for life in lives)
    if nowhere:
        found.append(f"The commit of {_runs(nowhere)} is not known: made outside a git checkout.")
    resumed = sum(bool(life.versions.get("before")) for life in lives)
    if resumed:
        found.append(f"{_runs(resumed)} went on with other versions than they began with.")
    for variant in variants:
        own = differing({str(life.seed): [life.config] for life in variant.lives})
        own.pop("movements", None)  # said where unfinished runs are
        if own:
            found.append(f"The seeds of {variant.label} are not of one configuration: they differ in {', '.join(own)}.")
        if len({life.wanted for life in variant.lives}) > 1:
            lengths = sorted({life.wanted for life in variant.lives})
            found.append(f"The runs of {variant.label} are not equally long: {', '.join(map(str, lengths))} movements.")
    lasts = sorted({variant.last for variant in variants if variant.last})
    if len(lasts) > 1:
        found.append(f"Last errors are of different ages: after {', '.join(map(str, lasts))} movements.")
    benchmarks = {life.config.get("benchmark_crc32") for life in lives}
    if len(benchmarks) > 1:
        found.append("The runs were judged by different benchmarks, so their errors cannot be compared.")
    return found


def disagreeing(lives: Sequence[Life]) -> dict[str, list[Any]]:
    """Library -> its versions, where the runs do not have the same."""
    names = dict.fromkeys(name for life in lives for name in life.versions if name != "before")
    found = {name: list(dict.fromkeys(str(life.versions.get(name)) for life in lives)) for name in names}
    return {name: values for name, values in found.items() if len(values) > 1}


def _needless(algorithm: str) -> tuple[str, str]:
    """Said already: a run is called like its algorithm anyway."""
    return f"--algorithm={algorithm}", f"--name={algorithm}"


def _line(words: str, seeds: Sequence[int]) -> str:
    start = "python experiments/run.py"
    if len(seeds) == 1:
        return f"{start} {words} --seed={seeds[0]} --out={AGAIN}"
    return f"for seed in {' '.join(map(str, seeds))}; do\n  {start} {words} --seed=$seed --out={AGAIN}\ndone"


def _runs(n: int) -> str:
    return "1 run" if n == 1 else f"{n} runs"
