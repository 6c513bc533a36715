"""Learners, a few lines each: the paper's five in ``paper``, ours in ``practice``."""

from collections.abc import Callable
from typing import TypeAlias

from sgimd_torch.parts import Inverse, Problem

MakeInverse: TypeAlias = Callable[[Problem], Inverse]
