"""The page of a report: what was run, what came of it, curves, maps, films, and how to do it again.

html = page(title, variants, sections, place=..., damaged=[...])
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.views.report import figures
from sgimd_torch.views.report.data import EARLY, Life, Variant
from sgimd_torch.views.report.html import Html, document, joined, table, tag
from sgimd_torch.views.report.record import configurations, repetition, versions
from sgimd_torch.views.report.repeat import doubts
from sgimd_torch.views.report.section import drawn
from sgimd_torch.views.report.words import TERMS, count, show, summary, title
from sgimd_torch.views.statistics import Interval

ORIGINS: Final = {"global": "global", "local": "local", "imitate": "imitation", "babble": "random", "": "at rest"}
SHOWN: Final = ("demonstrations shown", "of them different")


def page(
    place: Path,
    variants: Sequence[Variant],
    sections: Sequence[Html],
    damaged: Sequence[str],
    *,
    notes: Sequence[str] = (),
) -> Html:
    """Everything, as one file.

    Args:
        place: where the runs were found.
        variants: the best first, not empty.
        sections: of the variants, as ``section`` makes them.
        damaged: a line for each run that could not be read.
        notes: what else is to be known, such as films that were left out.
    """
    lives = [life for variant in variants for life in variant.lives]
    single = len(lives) == 1
    body = [
        tag("header", tag("h1", title(variants)), tag("p", summary(variants), class_="lead"), _navigation(variants)),
        _warnings(variants, damaged, notes),
        tag("h2", "Results", id="results"),
        *([_evaluations(lives[0])] if single else _results(variants)),
        *([] if single else _overview(variants)),
        *sections,
        *configurations(variants),
        *versions(variants),
        *repetition(variants),
        tag(
            "footer",
            tag("h2", "Words"),
            tag("p", TERMS),
            tag("p", f"Made from {place} by scripts/report.", class_="soft"),
        ),
    ]
    return document(title(variants), body)


def _navigation(variants: Sequence[Variant]) -> Html:
    if len(variants) < 2:
        return Html()
    links = [tag("a", variant.label, href=f"#variant-{k}") for k, variant in enumerate(variants)]
    rest = [tag("a", name, href=f"#{name.lower()}") for name in ("Configurations", "Versions", "Commands")]
    return tag("nav", tag("ul", *(tag("li", link) for link in (*links, *rest))), aria_label="Sections")


def _warnings(variants: Sequence[Variant], damaged: Sequence[str], notes: Sequence[str]) -> Html:
    cut = [
        f"{variant.label}, seed {life.seed}: {life.movements} of {life.wanted} movements"
        for variant in variants
        for life in variant.lives
        if not life.finished
    ]
    found = doubts(variants)
    if cut:
        left_out = any(len(v.used) < len(v.lives) and v.finished for v in variants)
        rest = "; they are in the maps, but not in the errors over seeds" if left_out else ""
        found.append(f"{count(len(cut), 'run')} not finished, stopped or still under way{rest}: {'; '.join(cut)}.")
    found += [f"Left out, damaged: {line}" for line in damaged]
    found += notes
    if not found:
        return Html()
    return tag(
        "aside", tag("strong", "Before you rely on this"), tag("ul", *(tag("li", line) for line in found)), role="note"
    )


def _results(variants: Sequence[Variant]) -> list[Html]:
    head = ["variant", "seeds", "movements", f"error after {EARLY} (m)", "last error (m)", "noise floor (m)"]
    rows = [
        [
            *(tag("a", v.label, href=f"#variant-{k}"), _seeds(v), str(v.last or "–"), show(v.early), show(v.final)),
            *(show(v.floor and Interval(*(v.floor.value,) * 3)), show(v.ratio, ".2f"), show(v.area)),
        ]
        for k, v in enumerate(variants)
    ]
    caption = "Errors, the best variant first; interquartile means over seeds, 95 % intervals in brackets"
    errors = table([*head, "times the floor", "error over life (m)"], rows, caption=caption)
    origins = _origins([life for variant in variants for life in variant.lives])
    shares = [f"{ORIGINS.get(origin, origin)} (%)" for origin in origins]
    head = ["variant", *shares, *SHOWN, "physics (s)", "learning (s)", "evaluation (s)"]
    caption = "How they lived: where movements came from, what they were shown, what it cost; means over runs"
    return [errors, table(head, [[v.label, *_life_cells(v, origins)] for v in variants], caption=caption)]


def _seeds(variant: Variant) -> str:
    used, n = len(variant.used), len(variant.lives)
    return str(n) if used == n else f"{used} of {n}"


def _origins(lives: Sequence[Life]) -> list[str]:
    """Those that occur, the usual ones first."""
    found = {origin for life in lives for origin in life.origins}
    return [*(origin for origin in ORIGINS if origin in found), *sorted(found - ORIGINS.keys())]


def _life_cells(variant: Variant, origins: Sequence[str]) -> list[str]:
    lives = variant.used or variant.lives
    moved = sum(life.movements for life in lives)
    counts = [sum(life.origins[origin] for life in lives) for origin in origins]
    shown = [np.mean([len(life.shown) for life in lives]), np.mean([len(set(life.shown.tolist())) for life in lives])]
    seconds = [np.mean([life.seconds(part) for life in lives]) for part in ("physics", "learner", "evaluation")]
    return [
        *(f"{100 * count / moved:.1f}" if count else "–" for count in counts),
        *(f"{value:.0f}" if value else "–" for value in shown),
        *(f"{value:.1f}" if np.isfinite(value) else "–" for value in seconds),
    ]


def _evaluations(life: Life) -> Html:
    rows = [
        [str(int(when)), *(f"{value:.4f}" if np.isfinite(value) else "–" for value in values)]
        for when, *values in zip(*life.evaluation.values(), strict=True)
    ]
    head = ["movements", "mean error (m)", "median (m)", "90th percentile (m)", "noise floor (m)"]
    shares = [
        f"{100 * life.origins[o] / life.movements:.1f} % {ORIGINS.get(o, o)}"
        for o in _origins([life])
        if life.movements
    ]
    told = f"Movements: {', '.join(shares)}. " if shares else ""
    if len(life.shown):
        told += f"{count(len(life.shown), 'demonstration')} shown, {len(set(life.shown.tolist()))} different."
    return joined([table(head, rows, caption="Every evaluation"), tag("p", told)])


def _overview(variants: Sequence[Variant]) -> list[Html]:
    evaluated = [variant for variant in variants if variant.last]
    if len(variants) < 2 or not evaluated:
        return []
    best = evaluated[: figures.MOST_CURVES]
    which = f" The {len(best)} that err least; all are below." if len(best) < len(evaluated) else ""
    words = f"How the error falls: interquartile means over seeds, bands are 95 % intervals.{which}"
    found = [drawn(figures.curves(best), f"Error curves of {', '.join(v.label for v in best)}", words, wide=True)]
    reference = next((variant for variant in evaluated if variant.name == "sgim-d"), evaluated[0])
    forest = figures.differences(evaluated, reference)
    if forest is not None:
        words = f"Last error less that of {reference.label}, paired by seed: interquartile means with 95 % intervals, "
        words += "full where they exclude 0; ticks are seeds. Left of the line is better."
        found.append(drawn(forest, f"Differences of error to {reference.label}", words, wide=True))
    return found
