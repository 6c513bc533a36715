"""Learners in a few lines each: the five of the paper in ``paper``, our own in ``practice``."""

from collections.abc import Callable
from typing import TypeAlias

from sgimd_torch.parts import Inverse, Problem

MakeInverse: TypeAlias = Callable[[Problem], Inverse]
