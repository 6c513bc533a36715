"""What a report says in sentences: the numbers of one run, of one variant, of many.

print(summary(variants))    # the best first
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sgimd_torch.views.report.data import Life, Variant
from sgimd_torch.views.statistics import Interval

TERMS: Final = (
    "The error is the mean distance between the goals of a benchmark and where a movement lands when the learner is "
    "asked for them. The noise floor is the part of it that motor noise alone makes. Over seeds the page gives "
    "interquartile means, means of the middle half, with 95 % bootstrap intervals in brackets; with fewer than ten "
    "seeds these are too narrow. Error over life is the area under the error curve, divided by its width."
)


def title(variants: Sequence[Variant]) -> str:
    """Of the page."""
    lives = [life for variant in variants for life in variant.lives]
    if len(lives) == 1:
        return f"{variants[0].label}, seed {lives[0].seed}"
    if len(variants) == 1:
        return f"{variants[0].label}: {count(len(lives), 'seed')}"
    return f"{len(variants)} variants, {len(lives)} runs"


def summary(variants: Sequence[Variant]) -> str:
    """One paragraph: what was run and what came of it; the best variant comes first."""
    best, worst = variants[0], next((v for v in reversed(variants) if v.final), variants[0])
    if len(variants) == 1:
        return _of_one(best.lives[0]) if len(best.lives) == 1 else sentence(best)
    if best.final is None:
        return "No run has been evaluated yet, or an error is missing."
    text = f"{len(variants)} variants were run with up to {count(max(len(v.lives) for v in variants), 'seed')} each. "
    text += f"The one that errs least is {best.label}. {sentence(best)}"
    if worst is not best and worst.final:
        text += f" The one that errs most is {worst.label}, with {show(worst.final)} m after {worst.last} movements."
    return text


def sentence(variant: Variant) -> str:
    """How near one variant came to its goals, and to what motor noise allows."""
    if variant.final is None:
        return "It has not been evaluated yet."
    over = f", interquartile mean over {count(len(variant.used), 'seed')}" if len(variant.used) > 1 else ""
    low = f" with a 95 % interval from {variant.final.low:.3f} to {variant.final.high:.3f} m" if over else ""
    text = f"After {variant.last} movements it lands {variant.final.value:.3f} m from a goal{over}{low}."
    if variant.floor and variant.ratio:
        times = show(variant.ratio, ".2f")
        text += f" Motor noise alone makes {variant.floor.value:.3f} m: the error is {times} times that."
    return text


def show(found: Interval | None, form: str = ".3f") -> str:
    """``0.060 [0.058, 0.062]``; without brackets where there is one seed, a dash where there is nothing."""
    if found is None:
        return "–"
    alone = found.low == found.value == found.high
    return f"{found.value:{form}}" + ("" if alone else f" [{found.low:{form}}, {found.high:{form}}]")


def count(n: int, what: str) -> str:
    """``1 seed``, ``2 seeds``."""
    return f"{n} {what}{'s' * (n != 1)}"


def _of_one(life: Life) -> str:
    last = int(life.evaluation["movements"][-1]) if len(life.evaluation["movements"]) else 0
    text = f"One run of {life.config['algorithm']}, {life.movements} of {life.wanted} movements. "
    if not last:
        return text + "It was never evaluated."
    mean, middle, most, floor = (
        life.at(last, f"{name}_m") for name in ("mean_error", "median_error", "p90_error", "noise_floor")
    )
    text += f"After {last} movements it lands {mean:.3f} m from a goal on the mean; for half of the goals within "
    text += f"{middle:.3f} m, for nine of ten within {most:.3f} m. "
    if floor > 0:
        text += f"Motor noise alone makes {floor:.3f} m, so the error is {mean / floor:.2f} times the noise floor. "
    parts = [
        (name, life.seconds(part))
        for name, part in (("physics", "physics"), ("learning", "learner"), ("evaluations", "evaluation"))
    ]
    told = [f"{name} {seconds:.0f} s" for name, seconds in parts if np.isfinite(seconds)]
    return text + (f"Time spent: {', '.join(told)}." if told else "")
