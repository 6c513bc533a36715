"""A teacher whom a learner should not ask: every demonstration has a wrong outcome.

sgimd run --algorithm sgim-acts --teachers all,experiments.mislabelling:mislabelling     # in the repository's root
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgimd_torch.extras.asking.teachers import AnsweringTeacher
from sgimd_torch.spaces import Demonstration, stream


def mislabelling(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> AnsweringTeacher:
    """Teacher who has all demonstrations, but states a wrong outcome for each."""
    (seed, *_) = rng.bit_generator.seed_seq.entropy  # type: ignore[attr-defined]
    own = stream(int(seed), "teacher mislabelling")  # the stream of the rows in results/, whatever this teacher's place
    return AnsweringTeacher(demonstrations, own, knows=mislabelled)


def mislabelled(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> Sequence[Demonstration]:
    """All demonstrations, each with the outcome of another demonstration, so that every stated outcome is wrong."""
    shift = 1 + int(rng.integers(max(1, len(demonstrations) - 1)))
    order = rng.permutation(len(demonstrations))
    labels = {int(row): demonstrations[label].outcome for row, label in zip(order, np.roll(order, shift), strict=True)}
    return [replace(demonstration, outcome=labels[row]) for row, demonstration in enumerate(demonstrations)]
