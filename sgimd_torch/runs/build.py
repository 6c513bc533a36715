"""The composition root: from a ``Config`` to the parts of a run. Each option gets its meaning here.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from sgimd_torch import algorithms
from sgimd_torch.algorithms import Correspondence, MakeGoals, MakeSearch, MakeSocial, Parts, emulating, imitating
from sgimd_torch.demonstrations import SHIPPED as SHIPPED_DEMONSTRATIONS
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import SHIPPED as SHIPPED_BENCHMARK
from sgimd_torch.evaluation import Benchmark, load_benchmark
from sgimd_torch.learner import Learner
from sgimd_torch.runs.config import (
    ALGORITHMS,
    CHOICES,
    COMPETENCES,
    GOALS,
    INVERSES,
    MODEL_SEARCHES,
    PROGRESS,
    SEARCHES,
    Config,
    Inverse,
    rival,
)
from sgimd_torch.runs.tasks import ARMS, arm_benchmark, arm_demonstrations
from sgimd_torch.spaces import Box, Demonstration, stream
from sgimd_torch.teachers import AskedTeacher, InitialTeacher, PeriodicTeacher, Teacher

if TYPE_CHECKING:
    from sgimd_torch.forward_model.anchored import Trust
    from sgimd_torch.forward_model.model import ForwardModel

STRETCH = 3.0  # times longer or shorter than the robot can move is no matter of pace
MISFIT = 0.5  # rad; a worse fit is no movement of this robot
LEAST_NOISE = 0.01  # m; where outcomes have none, predictions still are not better than this


@dataclass(frozen=True, eq=False)
class RunParts:
    """What a run needs. ``correspondence`` translates a demonstrated trajectory to theta. ``inverse`` reads the
    learner's memory for evaluations; ``model``, to be refreshed after each movement, is None for a run without one, as
    is how far to ``trust`` it; ``teacher`` is None, and ``demonstrations`` are empty, for who learns alone.
    ``residuals`` (rad) say how far each is from what the robot can play. ``data`` holds checksums of the files that
    were read."""

    environment: FishingRod | PlanarArm
    correspondence: Correspondence
    learner: Learner
    teacher: Teacher | None
    demonstrations: Sequence[Demonstration]
    residuals: Sequence[float]
    inverse: Inverse
    benchmark: Benchmark
    data: dict[str, str | None]
    model: ForwardModel | None
    trust: Trust | None


def build(config: Config) -> RunParts:
    """Put a run together; nothing is executed yet.

    Raises:
        ValueError: a part refuses its option, or a file does not fit the robot.
        FileNotFoundError: there is no such file.
    """
    robot: FishingRod | PlanarArm
    if config.environment in ARMS:
        robot = PlanarArm(ARMS[config.environment])
        correspondence = robot.correspondence
    else:
        half_side = config.task_space
        robot = FishingRod(noise=config.noise, outcomes=Box.cube(-half_side, half_side, 2), threads=config.threads)
        correspondence = robot.primitive.correspondence
    benchmark, benchmark_crc32 = _benchmark(config, robot)
    benchmark.check(robot)
    demonstrations: Sequence[Demonstration] = []
    residuals: list[float] = []
    teacher, demonstrations_crc32 = None, None
    if "teacher" in ALGORITHMS[config.algorithm]:
        demonstrations, residuals, demonstrations_crc32 = _demonstrations(config, robot)
        teacher = _teacher(config, demonstrations)
    model, trust = _model(config, robot)
    learner = _learner(config, robot, correspondence, _search(config, model, trust))
    inverse = INVERSES[config.inverse](learner.memory)
    if config.inverse == "model":
        inverse = rival("inverses.through_model", "ModelInverse")(learner.memory, model, robot.policies, trust=trust)
    data = {"demonstrations_crc32": demonstrations_crc32, "benchmark_crc32": benchmark_crc32}
    return RunParts(
        robot, correspondence, learner, teacher, demonstrations, residuals, inverse, benchmark, data, model, trust
    )


def _model(config: Config, robot: FishingRod | PlanarArm) -> tuple[ForwardModel | None, Trust | None]:
    """The forward model and how far to trust it, None without; torch is loaded here, and only if it is wanted."""
    if not config.uses_model:
        return None, None
    model = rival("forward_model.model", "ForwardModel")(
        *(robot.contexts.dim, robot.policies.dim, robot.outcomes.dim),
        seed=config.seed,
        members=config.members,
        noise_heads=config.noise_heads,
        rate=config.training,
        focus=config.focus,
    )
    return model, rival("forward_model.anchored", "Trust")(
        noise=max(robot.outcome_noise, LEAST_NOISE), anchors=config.anchored
    )


def _search(config: Config, model: ForwardModel | None, trust: Trust | None) -> MakeSearch:
    if config.search not in MODEL_SEARCHES or model is None:
        return SEARCHES.get(config.search, SEARCHES["nelder-mead"])  # who has no goals of his own needs none
    name, options = MODEL_SEARCHES[config.search]
    chosen = {**options, "model": model, "trust": trust}
    if "propose" in options:
        chosen["propose"] = rival("searches.through_model", options["propose"])
    if name == "gradient_search":
        chosen["residual"] = config.residual
    return partial(rival("searches.through_model", name), **chosen)


def _benchmark(config: Config, robot: FishingRod | PlanarArm) -> tuple[Benchmark, str | None]:
    """The goals, and the checksum of their file; None of those that are made for an arm."""
    if config.benchmark is None and isinstance(robot, PlanarArm):
        return arm_benchmark(robot), None
    path = _existing("benchmark", config.benchmark or SHIPPED_BENCHMARK)
    return load_benchmark(path), _checksum(path)


def _demonstrations(
    config: Config, robot: FishingRod | PlanarArm
) -> tuple[Sequence[Demonstration], list[float], str | None]:
    """What is shown, what each leaves of itself (rad), and the checksum of the file, None without one."""
    if config.demonstrations is None and isinstance(robot, PlanarArm):
        demonstrations = arm_demonstrations(robot)
        return demonstrations, [0.0] * len(demonstrations), None
    path = _existing("demonstrations", config.demonstrations or SHIPPED_DEMONSTRATIONS)
    demonstrations = load_demonstrations(
        path,
        n_joints=robot.policies.dim if isinstance(robot, PlanarArm) else len(JOINTS),
        outcome_dim=robot.outcomes.dim,
        context_dim=robot.contexts.dim,
    )
    return demonstrations, _residuals(path, demonstrations, robot), _checksum(path)


def _learner(config: Config, environment: Environment, correspondence: Correspondence, search: MakeSearch) -> Learner:
    goals: MakeGoals = GOALS[config.goals]
    if config.goals in ("interest-map", "grid"):
        goals = partial(GOALS[config.goals], window=config.window, progress=PROGRESS[config.progress])
    social: MakeSocial = emulating
    if config.social == "imitate":
        social = partial(imitating, repeats=config.imitations, epsilon=config.epsilon)
    parts: Parts = {
        "goals": goals,
        "inverse": INVERSES[config.inverse],
        "search": search,
        "judge": COMPETENCES[config.competence],
        "budget": config.budget,
    }
    match config.algorithm:
        case "random":
            return algorithms.random_exploration(environment, config.seed)
        case "sagg-riac":
            return algorithms.sagg_riac(environment, config.seed, **parts)
        case "observation":
            return algorithms.observation(environment, config.seed, correspondence=correspondence)
        case "imitation":
            return algorithms.imitation(environment, config.seed, correspondence=correspondence, epsilon=config.epsilon)
        case "map-elites":
            return rival("rivals.quality_diversity", "map_elites")(environment, config.seed)
        case "cma-me":
            return rival("rivals.quality_diversity", "cma_me")(environment, config.seed)
    return algorithms.sgim_d(environment, config.seed, correspondence=correspondence, social=social, **parts)


def _teacher(config: Config, demonstrations: Sequence[Demonstration]) -> Teacher:
    rng, choose = stream(config.seed, "teacher"), CHOICES[config.choice]
    every = {} if config.every is None else {"every": config.every}
    match config.teacher:
        case "initial":
            return InitialTeacher(demonstrations, rng, **every)
        case "asked":
            patience = {} if config.every is None else {"patience": config.every}
            return AskedTeacher(demonstrations, rng, choose=choose, **patience)
    return PeriodicTeacher(demonstrations, rng, choose=choose, **every)


def _residuals(path: Path, demonstrations: Sequence[Demonstration], robot: FishingRod | PlanarArm) -> list[float]:
    """What the correspondence leaves of each demonstration, eq. (6), rad; refuses what it cannot translate."""
    residuals: list[float] = []
    for row, demonstration in enumerate(demonstrations):
        try:
            residuals.append(_residual(demonstration, robot))
        except ValueError as error:
            raise ValueError(f"{path}: recording {row} cannot be translated: {error}") from error
    return residuals


def _residual(demonstration: Demonstration, robot: FishingRod | PlanarArm) -> float:
    times, trajectory = demonstration.times, demonstration.trajectory
    if isinstance(robot, PlanarArm):
        robot.correspondence(times, trajectory)
        return 0.0  # its last posture, all that matters, is met exactly
    duration, (shortest, longest) = times[-1] - times[0], robot.primitive.durations
    if not shortest / STRETCH <= duration <= longest * STRETCH:
        raise ValueError(
            f"it lasts {duration:g} s, the robot's movements {shortest:g} to {longest:g} s; "
            "was it recorded in milliseconds?"
        )
    residual = robot.primitive.residual(robot.primitive.correspondence(times, trajectory), times, trajectory)
    if residual > MISFIT:
        raise ValueError(
            f"it is {residual:.2f} rad (root mean square) away from anything that the robot can play; "
            "was it recorded in degrees, or with the joints in another order?"
        )
    return residual


def _existing(what: str, path: Path) -> Path:
    if path.is_dir():
        raise IsADirectoryError(f"{what}: {path} is a directory, a file was wanted")
    if not path.is_file():
        raise FileNotFoundError(f"{what}: there is no file {path}")
    return path


def _checksum(path: Path) -> str:
    return f"{zlib.crc32(path.read_bytes()):08x}"
