"""What a run is made of: one documented field for each choice; the command line of ``run.py`` is made from them.

Each default is read off the library, where it is explained, and each option is an ablation of one changed word.
    config = Config(algorithm="sagg-riac", goals="uniform", name="uniform-goals")
"""

from __future__ import annotations

import difflib
import importlib.util
import inspect
import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, Final

from sgimd_torch.algorithms import MakeSearch, attempted, emulating, goal_babbling, imitating, remembered
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import evaluate
from sgimd_torch.goals.interest_map import Goals, InterestMap, UniformGoals
from sgimd_torch.goals.progress_grid import ProgressGrid
from sgimd_torch.goals.regions import absolute_progress, gained_progress, paired_progress, signed_progress
from sgimd_torch.inverses.local import LocalInverse, NearestNeighbour
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.memory import Memory
from sgimd_torch.runs.tasks import ARMS, ENVIRONMENTS, ROD
from sgimd_torch.searches.perturb import perturb
from sgimd_torch.searches.simplex import nelder_mead
from sgimd_torch.spaces import Array, Estimate
from sgimd_torch.teachers import AskedTeacher, InitialTeacher, PeriodicTeacher, at_random, least_explored

Inverse = Callable[[Array, Array], Estimate]


def rival(module: str, name: str) -> Callable[..., Any]:
    """What ``sgimd_torch.module`` has by that name; imported when it is called, with the package that it needs.

    Raises:
        ValueError: when called: that package is not installed, or broken.
    """

    def make(*arguments: Any, **options: Any) -> Any:
        try:
            part = getattr(importlib.import_module(f"sgimd_torch.{module}"), name)
        except ImportError as error:
            raise ValueError(str(error)) from error
        return part(*arguments, **options)

    return make


_GOAL_BABBLING: Final = ("goals", "window", "progress", "competence", "search", "budget")
_MODEL: Final = ("members", "noise_heads", "training", "focus", "anchored")
_TAUGHT: Final = ("teacher", "every", "choice", "demonstrations")
# Each with the options that not all of them use.
ALGORITHMS: Final[dict[str, tuple[str, ...]]] = {
    "random": (),
    "sagg-riac": _GOAL_BABBLING,
    "imitation": (*_TAUGHT, "epsilon"),
    "observation": _TAUGHT,
    "sgim-d": (*_GOAL_BABBLING, *_TAUGHT, "social", "imitations", "epsilon"),
    "map-elites": (),
    "cma-me": (),
}
GOALS: Final[dict[str, Callable[..., Goals]]] = {
    "interest-map": InterestMap,
    "grid": ProgressGrid,
    "alp-gmm": rival("goals.alp_gmm", "AlpGmm"),
    "uniform": UniformGoals,
}
PROGRESS: Final = {
    "gained": gained_progress,
    "absolute": absolute_progress,
    "signed": signed_progress,
    "paired": paired_progress,
}
SEARCHES: Final[dict[str, MakeSearch]] = {
    "nelder-mead": nelder_mead,
    "nelder-mead-exact": partial(nelder_mead, noise=0.0),
    "nelder-mead-complete": partial(nelder_mead, noise=0.0, complete=True),
    "perturb": perturb,
    "cma-es": rival("searches.cma_es", "cma_es"),
}
# Through the forward model, by what ``sgimd_torch.gradient_search`` calls them.
MODEL_SEARCHES: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "gradient": ("gradient_search", {}),
    "gauss-newton": ("gradient_search", {"propose": "gauss_newton"}),
    "screened": ("gradient_search", {"propose": "screen", "noise": 0.0}),
    "nelder-mead-polished": ("polished_simplex", {}),
}
INVERSES: Final[dict[str, Callable[[Memory], Inverse]]] = {
    "linear": LocallyLinear,
    "paper": LocalInverse,
    "nearest": NearestNeighbour,
    "model": LocallyLinear,  # while it learns; in evaluations through the forward model
}
COMPETENCES: Final = {"memory": remembered, "attempt": attempted}
ANSWERS: Final = {"imitate": imitating, "emulate": emulating}
TEACHERS: Final = {"periodic": PeriodicTeacher, "initial": InitialTeacher, "asked": AskedTeacher}
CHOICES: Final = {"least-explored": least_explored, "random": at_random}
KNOWN: Final[dict[str, dict[str, Any]]] = {
    "algorithm": ALGORITHMS,
    "environment": dict.fromkeys(ENVIRONMENTS),
    "goals": GOALS,
    "progress": PROGRESS,
    "competence": COMPETENCES,
    "search": {**SEARCHES, **MODEL_SEARCHES},
    "inverse": INVERSES,
    "social": ANSWERS,
    "teacher": TEACHERS,
    "choice": CHOICES,
}
# Choices that leave other options without a use.
_MOOT: Final = {
    **{("environment", arm): ("noise", "task_space") for arm in ARMS},
    ("goals", "uniform"): ("window", "progress", "competence"),
    ("goals", "alp-gmm"): ("window", "progress"),
    ("social", "emulate"): ("imitations", "epsilon"),
    ("teacher", "initial"): ("choice",),
}
_MOST_THREADS: Final = max(64, os.cpu_count() or 1)
_MOST_MEMBERS: Final = 100


def _default(function: Callable[..., Any], name: str) -> Any:
    return inspect.signature(function).parameters[name].default


def _name_of(table: dict[str, Any], function: Callable[..., object], name: str) -> str:
    return next(key for key, part in table.items() if part is _default(function, name))


@dataclass(frozen=True)
class Config:
    """One run.

    Args:
        algorithm: Who learns: random, sagg-riac, imitation, observation or sgim-d; or of another school map-elites or
            cma-me, which fill an archive of outcomes (these need sgimd-torch[rivals]).
        seed: Seed of all random streams of the run, at least 0; the same seed gives the same files, byte for byte.
        movements: Length of the learner's life, movements at rest counted.
        out: Directory for runs; this one goes to OUT/NAME/seed-003.
        name: NAME in that path, to keep a variant apart; null is the algorithm's name.
        environment: Where it lives: fishing-rod, or planar-arm-7 or planar-arm-50, an arm of that many joints whose
            outcome is where it ends (m); it moves without noise.
        noise: Motor noise (s), standard deviation of the command (rad) for each rad/s of commanded speed; 0 is none.
        task_space: Half the side (m) of the square that goals come from; 100 in the paper's large-space experiment.
        goals: Where goals come from (sagg-riac, sgim-d): interest-map; grid, the same interest in cells that never
            split; alp-gmm, Gaussians of high progress (needs sgimd-torch[rivals]); uniform, the same everywhere.
        window: How many competences of a region its interest is measured over, the paper's zeta; even (sagg-riac,
            sgim-d).
        progress: What is interesting (sagg-riac, sgim-d): gained, how much attempts raise the competence at their own
            goals; absolute, newer competences against older ones, as in the paper; signed, which ignores falling
            competence; or paired, the mean difference from the competence at the nearest earlier goal.
        competence: What a goal's competence is judged by (sagg-riac, sgim-d): memory, all movements ever made, as in
            the paper, or attempt, those made for this goal.
        search: How a movement is refined (sagg-riac, sgim-d): nelder-mead, from the neighbours, with a little noise on
            every movement; nelder-mead-exact, without the noise; nelder-mead-complete, which first fills up the paper's
            simplex of 26, too; perturb, the best so far plus noise; cma-es (needs sgimd-torch[rivals]). Through a
            forward model (these need sgimd-torch[forward]): gradient, down its gradient, or gauss-newton, each movement
            planned anew; screened, the best of 64 variations; nelder-mead-polished, a simplex from where it would go.
        budget: Movements for one goal, at most (sagg-riac, sgim-d).
        inverse: Which movement is inferred for a goal, when learning and in evaluations: paper, the weighted mean of
            eq. (9); linear, the same corrected to first order; nearest, the movement that came nearest; model, linear
            when learning, and in evaluations what a forward model makes of it (needs sgimd-torch[forward]); that
            pays for those who explore and misleads the imitation learner.
        members: Networks in the forward model; it is learnt if the search or the inverse is one of those that use it.
        noise_heads: Whether the forward model's noise depends on the movement, true or false.
        training: Steps of training the forward model for each movement; 0.3 takes about a fifth of the rod's physics.
        focus: Share of training drawn from what landed near the goal pursued, 0 to 0.75.
        anchored: Whether predictions are corrected by what the forward model missed nearby, true or false.
        residual: Whether, besides, by the outcomes of the search under way (gradient, gauss-newton, screened).
        social: How sgim-d answers a demonstration: imitate it, or emulate, pursue its outcome in the learner's own way.
        imitations: Movements that sgim-d spends on imitating a demonstration.
        epsilon: Bound of the variation in each parameter of theta when imitating (imitation, sgim-d).
        teacher: When demonstrations come (imitation, observation, sgim-d): periodic, initial (all at the start) or
            asked (when the learner stalls).
        every: Movements from one demonstration to the next, or from one look at the learner to the next (asked); null
            is that teacher's own number.
        choice: Which demonstration comes (periodic, asked): least-explored by the learner, or random.
        demonstrations: File of recorded demonstrations; null is the shipped one, on an arm the one made for it.
        evaluate_at: Movements after which to evaluate, besides the end, such as 250,500; null is 250, 500 and every
            1000; [] never evaluates, not at the end either. Evaluating changes nothing in the run.
        repeats: How many times an evaluation executes each chosen movement again to measure the noise, at least 2; 0
            leaves the noise out.
        floor_at: Which evaluations measure the noise, such as 1000,5000; it takes ten times as long as the error. null
            is all of them.
        benchmark: File of the goals to evaluate on; null is the shipped one, on an arm the one made for it.
        threads: Threads that an evaluation may use; results do not depend on it.
        board: Show the run in TensorBoard, true or false; scripts/watch OUT opens it. Showing changes nothing in it.
    """

    algorithm: str = "sgim-d"
    seed: int = 0
    movements: int = 5000
    out: Path = Path("runs")
    name: str | None = None
    environment: str = ROD
    noise: float = _default(FishingRod, "noise")
    task_space: float = 1.0
    goals: str = _name_of(GOALS, goal_babbling, "goals")
    window: int = _default(InterestMap, "window")
    progress: str = _name_of(PROGRESS, InterestMap, "progress")
    competence: str = _name_of(COMPETENCES, goal_babbling, "judge")
    search: str = _name_of(SEARCHES, goal_babbling, "search")
    budget: int = _default(goal_babbling, "budget")
    inverse: str = _name_of(INVERSES, goal_babbling, "inverse")
    members: int = 3
    noise_heads: bool = True
    training: float = 0.3
    focus: float = 0.0
    anchored: bool = True
    residual: bool = True
    social: str = "imitate"
    imitations: int = _default(imitating, "repeats")
    epsilon: float = _default(imitating, "epsilon")
    teacher: str = "periodic"
    every: int | None = None
    choice: str = _name_of(CHOICES, PeriodicTeacher, "choose")
    demonstrations: Path | None = None
    evaluate_at: tuple[int, ...] | None = None
    repeats: int = _default(evaluate, "repeats")
    floor_at: tuple[int, ...] | None = None
    benchmark: Path | None = None
    threads: int = 1
    board: bool = False

    def __post_init__(self) -> None:
        for name, known in KNOWN.items():
            _check_known(name, getattr(self, name), known)
        at_least = {"seed": 0, "movements": 1, "budget": 1, "imitations": 1, "repeats": 0, "threads": 1}
        at_least["members"] = 1
        for name, least in at_least.items():
            _check_least(name, getattr(self, name), least)
        if self.repeats == 1:
            raise ValueError("repeats must be 0 or at least 2, got 1; one landing point does not scatter")
        if self.every is not None:
            _check_least("every", self.every, 1)
        for name in ("evaluate_at", "floor_at"):
            for movements in getattr(self, name) or ():
                _check_least(name, movements, 1)
        if self.board and importlib.util.find_spec("tensorboard") is None:
            raise ValueError("board true needs tensorboard, which is not installed; pip install tensorboard")
        if not 0 <= self.noise < math.inf:
            raise ValueError(f"noise must be finite and at least 0, got {self.noise}")
        if self.members > _MOST_MEMBERS:
            raise ValueError(f"members must be at most {_MOST_MEMBERS}, got {self.members}; 5 are many")
        if not 0 < self.training <= 100:
            raise ValueError(f"training must be above 0 and at most 100 steps a movement, got {self.training}")
        if not 0 <= self.focus <= 0.75:
            raise ValueError(f"focus must be from 0 to 0.75, got {self.focus}; the rest is of what is new and old")
        if not 0 <= self.epsilon <= 1:
            raise ValueError(f"epsilon must be from 0 to 1, the width of theta's box, got {self.epsilon}")
        if not 0 < self.task_space <= 1e6:
            raise ValueError(f"task_space must be a length in metres above 0, at most 1e6, got {self.task_space}")
        if self.threads > _MOST_THREADS:
            raise ValueError(f"threads must be at most {_MOST_THREADS}, got {self.threads}")
        if self.variant in ("", ".", "..") or any(sign in self.variant for sign in "/\\\0"):
            raise ValueError(f"name must be that of one directory, got {self.variant!r}; is the path for --out?")

    @property
    def variant(self) -> str:
        """What the run's directory and its curve are called."""
        return self.algorithm if self.name is None else self.name

    @property
    def directory(self) -> Path:
        """Where the run is written."""
        return self.out / self.variant / f"seed-{self.seed:03d}"

    @property
    def uses_model(self) -> bool:
        """Whether a forward model is learnt."""
        searches = self.search in MODEL_SEARCHES and "search" in ALGORITHMS[self.algorithm]
        return searches or self.inverse == "model"

    @property
    def evaluations(self) -> list[int]:
        """The numbers of movements after which to evaluate, in order."""
        if self.evaluate_at == ():
            return []
        standard = (250, 500, *range(1000, self.movements, 1000))
        chosen = standard if self.evaluate_at is None else self.evaluate_at
        return sorted({movements for movements in chosen if movements < self.movements} | {self.movements})

    @property
    def without_effect(self) -> list[str]:
        """A note for each option that is not at its default but changes nothing in this run."""
        used = ALGORITHMS[self.algorithm]
        why = {name: f"on {self.algorithm}" for name in ALGORITHMS["sgim-d"] if name not in used}
        for (option, value), moot in _MOOT.items():
            if option in ("environment", *used) and getattr(self, option) == value:
                why |= dict.fromkeys(moot, f"with --{option} {value}")
        if not {"search", "epsilon"} & set(used):
            why["focus"] = f"on {self.algorithm}, which pursues no goals"
        if not self.uses_model:
            why |= dict.fromkeys(_MODEL, "without a forward model, see --search and --inverse")
        if "search" not in used or self.search not in [*MODEL_SEARCHES][:3]:
            why["residual"] = f"with --search {self.search}" if "search" in used else f"on {self.algorithm}"
        given = [field.name for field in fields(self) if getattr(self, field.name) != field.default]
        return [f"--{name} has no effect {why[name]}" for name in given if name in why]


def _check_known(what: str, name: str, known: Iterable[str]) -> None:
    known = list(known)
    if name not in known:
        near = difflib.get_close_matches(name.lower().replace("_", "-"), known, 1, 0.5)
        slip = f"; did you mean {near[0]}?" if near else ""
        raise ValueError(f"unknown {what} {name!r}, known are {', '.join(known)}{slip}")


def _check_least(name: str, value: int, least: int) -> None:
    if value < least:
        raise ValueError(f"{name} must be at least {least}, got {value}")
