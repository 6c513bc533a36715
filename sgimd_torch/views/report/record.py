"""For the record, in a report: what differs between configurations, the versions that made the runs, how to repeat."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any

from sgimd_torch.views.report.data import Variant, differing
from sgimd_torch.views.report.html import Html, table, tag
from sgimd_torch.views.report.repeat import AGAIN, commands, unknown


def configurations(variants: Sequence[Variant]) -> list[Html]:
    """A row for each variant, a column for each option in which not all agree; rare values stand out."""
    if len(variants) < 2:
        return []
    found = differing({variant.name: [life.config for life in variant.lives] for variant in variants})
    head = tag("h2", "What differs between the configurations", id="configurations")
    if not found:
        return [head, tag("p", "Nothing: all runs have the same options but for seed and name.")]
    told = {
        name: {key: " or ".join(map(_value, values)) for key, values in cells.items()} for name, cells in found.items()
    }
    usual = {name: Counter(cells.values()).most_common(1)[0][0] for name, cells in told.items()}
    rows = [
        [
            variant.label,
            *(
                tag("td", cells[variant.name], class_="usual" if cells[variant.name] == usual[name] else "other")
                for name, cells in told.items()
            ),
        ]
        for variant in variants
    ]
    caption = "Only options in which not all runs agree; values that most variants share are pale"
    return [head, table(["variant", *told], rows, caption=caption)]


def versions(variants: Sequence[Variant]) -> list[Html]:
    """Each set of versions once, and whose runs it made."""
    made: dict[str, Counter[str]] = {}
    for variant in variants:
        for life in variant.lives:
            made.setdefault(json.dumps(life.versions, sort_keys=True), Counter())[variant.label] += 1
    every = [json.loads(text) for text in made]
    names = list(dict.fromkeys(name for each in every for name in each))
    heads = ["runs of " + _listed(counts, len(variants)) for counts in made.values()]
    rows = [[name, *(_value(each.get(name)) for each in every)] for name in sorted(names, key=_first)]
    return [
        tag("h2", "Versions", id="versions"),
        table(["", *heads], rows, caption="What made the runs; one column for each set of versions", notes=True),
    ]


def repetition(variants: Sequence[Variant]) -> list[Html]:
    """Command lines, with the commit to go back to."""
    commits = {str(life.versions.get("commit")) for variant in variants for life in variant.lives}
    (commit,) = commits if len(commits) == 1 else ("None",)
    clean = commit != "None" and not commit.endswith("-dirty")
    back = [tag("p", "First: ", tag("code", f"git checkout {commit}"))] if clean else []
    found = [
        tag("h2", "Commands to repeat this", id="commands"),
        tag("p", f"From the root of a checkout, with .venv active; the runs go to {AGAIN}. Defaults are not named."),
        *back,
    ]
    for variant in variants:
        found += [tag("h3", variant.label), tag("pre", tag("code", "\n".join(commands(variant.lives))))]
        lost = unknown(variant.lives)
        if lost:
            found.append(tag("p", f"Options that this version does not have are missing here: {', '.join(lost)}."))
    return found


def _listed(counts: Counter[str], n_variants: int) -> str:
    if len(counts) == n_variants and n_variants > 3:
        return f"all {n_variants} variants ({sum(counts.values())} runs)"
    return ", ".join(f"{label} ({n})" for label, n in counts.items())


def _first(name: str) -> tuple[bool, str]:
    return name != "commit", name


def _value(value: Any) -> str:
    return "–" if value is None else value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
