"""What a user would pick instead: the lives of other people's programs, and of `practice` beside them.

    scripts/others                                     Explauto and BoTorch, into .others
    experiments/compare.py others                      the lives of the page OTHERS
    experiments/compare.py others --only arm-7 --seeds 1000 --results development

other_programs.py has the programs, and takes seconds to import.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import product
from pathlib import Path
from typing import Final

from lives import Life

COUNTS: Final = (50, 100, 300, 1000, 3000)  # movements after which all answer
SEEDS: Final = range(280, 290)
TABLE: Final = "others.csv"
ROBOTS: Final = ("arm-5", "arm-7", "arm-50", "soft-arm", "rod", "pusher-arm", "toss")
OURS: Final = "practice"
KNOWS: Final = "mink"  # it knows the robot, which must be a planar arm
PROGRAMS: Final = (
    *(OURS, "explauto", "pyribs-cma-me", "scikit-learn-process", "torch-network", "cma-es-each-goal"),
    *("botorch-each-goal", KNOWS),
)
TAKE_CONTEXTS: Final = (OURS, "scikit-learn-process", "torch-network", "botorch-each-goal")


def lives(seeds: Iterable[int] | None, only: Collection[str], out: Path) -> list[Life]:
    """The lives on these robots with these seeds, None for those of the page."""
    keys = product(SEEDS if seeds is None else seeds, only, PROGRAMS)
    return [Life(TABLE, (robot, name, seed), COUNTS[-1], out) for seed, robot, name in keys if _takes(name, robot)]


def _takes(name: str, robot: str) -> bool:
    return name in TAKE_CONTEXTS if robot == "toss" else name != KNOWS or robot.startswith("arm-")
