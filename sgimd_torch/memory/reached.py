"""What global movements reached, as explorer and goal model share it: ``problem.shared(Reached, Reached)``."""

from __future__ import annotations

from dataclasses import dataclass, field

from sgimd_torch.spaces import Array


@dataclass
class Reached:
    """Results of global movements.

    Attributes:
        rows: rows of the global movements in memory.
        confirmed: outcomes ``(outcome_dim,)`` that came again, though similar movements do not explain them.
    """

    rows: list[int] = field(default_factory=list)
    confirmed: list[Array] = field(default_factory=list)
