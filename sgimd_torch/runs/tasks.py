"""Tasks: an environment with what a study of it needs: benchmark goals, demonstrations, their correspondence.

Benchmark and demonstrations of the fishing rod are shipped files. Those of a planar arm, whose geometry is known
exactly, are made here, the same for every seed. An environment of your own may come alone, or as a ``Task``:
    def make(): return Task(Toss(), benchmark=my_goals, demonstrations=Path("shown.npz"), correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from sgimd_torch.algorithms import Correspondence
from sgimd_torch.demonstrations import SHIPPED as SHIPPED_DEMONSTRATIONS
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment, HandLed, Record, recorded
from sgimd_torch.environments.toys import Toy
from sgimd_torch.evaluation import SHIPPED as SHIPPED_BENCHMARK
from sgimd_torch.evaluation import Benchmark, load_benchmark, tile_goals
from sgimd_torch.files import checksum
from sgimd_torch.spaces import Array, Box, Demonstration, stream

if TYPE_CHECKING:
    from sgimd_torch.environments.fishing_rod import FishingRod

DATA: Final = SHIPPED_BENCHMARK.parent
SIDE: Final = 0.1  # m, of a benchmark tile; it leaves 311 goals in the disc of radius 1 m that these arms reach
SHOWN: Final = 127  # demonstrations, as many as each shipped demonstrator recorded
SAMPLES: Final = 5  # of each of them
REACHING: Final = 20_000  # uniform movements that show what a toy can reach
MOST_GOALS: Final = 500  # of a task that has none
STRETCH: Final = 3.0  # a demonstration this many times slower or faster than the robot can move has wrong times
MISFIT: Final = 0.5  # rad; a larger misfit means that this robot cannot make the movement


@dataclass(frozen=True, eq=False)
class Task:
    """What can be learnt, and how it is judged.

    Args:
        environment: the robot and its world.
        benchmark: goals of evaluation: a file, or a function that makes them; None for goals all over T.
        demonstrations: what a teacher has to show: a file, or a function that makes it; None for no teacher.
        correspondence: (times, trajectory) -> theta_d, eq. (6); None for the environment's own, if it has one.
        misfit: demonstration -> how far (rad) it is from what the robot can play; raises ValueError if it cannot be
            translated. None for the correspondence alone.
        n_joints: columns of a demonstrated trajectory; None for any.
        record: (context, theta, rng) -> a movement that `sgimd film` shows, see ``Sketch`` in environments/protocol.py;
            None for the environment's own, if it has one.
        hand_led: what a person can lead by the hand to teach it; None for the environment's own, if it has one.
    """

    environment: Environment
    benchmark: Path | Callable[[], Benchmark] | None = None
    demonstrations: Path | Callable[[], Sequence[Demonstration]] | None = None
    correspondence: Correspondence | None = None
    misfit: Callable[[Demonstration], float] | None = None
    n_joints: int | None = None
    record: Record | None = None
    hand_led: HandLed | None = None

    @property
    def picture(self) -> Record | None:
        """``record``, or that of the environment, which is then checked; None if neither has one that can be called."""
        found = self.record or getattr(self.environment, "record", None)
        return partial(recorded, self.environment, found) if callable(found) else None


def fishing_rod(
    *,
    noise: float,
    task_space: float,
    threads: int,
    max_yaw: float = 0.0,
    max_wind: float = 0.0,
    line: float = 1.0,
) -> Task:
    """The paper's task; goals come from a square of half side ``task_space`` m.

    With a context, ``max_yaw`` (rad) or ``max_wind`` (N) above 0, what was demonstrated was demonstrated in the context
    0, and the goals are those that can be reached in it. So, too, with another ``line``: both are those of the
    paper's rod.
    """
    from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod  # MuJoCo is loaded only when it is needed

    space = Box.cube(-task_space, task_space, 2)
    rod = FishingRod(noise=noise, outcomes=space, max_yaw=max_yaw, max_wind=max_wind, line=line, threads=threads)
    return Task(
        rod,
        SHIPPED_BENCHMARK,
        partial(_in_context_zero, rod.contexts.dim) if rod.contexts.dim else SHIPPED_DEMONSTRATIONS,
        rod.primitive.correspondence,
        partial(_misfit, rod),
        len(JOINTS),
    )


def planar_arm(*, n_joints: int) -> Task:
    """An arm without noise; its outcome is the position of its end."""
    arm = PlanarArm(n_joints)
    return Task(arm, partial(arm_benchmark, arm), partial(arm_demonstrations, arm), arm.correspondence, None, n_joints)


def swimmer() -> Task:
    """gymnasium's Swimmer-v5; its demonstrations are torques."""
    from sgimd_torch.environments.swimmer import Swimmer  # gymnasium is loaded only when it is needed

    robot, goals, shown = Swimmer(), DATA / "swimmer_benchmark.npz", DATA / "swimmer_demonstrations.npz"
    return Task(robot, goals, shown, misfit=robot.misfit, n_joints=2)


def half_reached() -> Task:
    """The arm of 7 joints, with a little noise and a T of which it cannot reach a half and a bit."""
    arm = PlanarArm(7, noise=0.02, outcomes=Box(np.array([-1.0, -1.0]), np.array([3.0, 1.0])))
    return Task(arm, partial(arm_benchmark, arm))


def toy(*, make: Callable[[], Toy], side: float, taught: bool = False) -> Task:
    """A toy robot; its goals lie on tiles of ``side``, in the unit of T. ``taught``: it has a teacher, too."""
    robot = make()
    shown = partial(toy_demonstrations, robot) if taught else None
    return Task(robot, partial(toy_benchmark, robot, side), shown, last_row if taught else None)


def toy_benchmark(robot: Toy, side: float) -> Benchmark:
    """One random goal in each tile that uniform movements reach, in the middle of C; always the same ones."""
    rng = stream(0, "goals for a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((REACHING, robot.policies.dim))
    context = (robot.contexts.low + robot.contexts.high) / 2
    reached = robot.effect(np.tile(context, (REACHING, 1)), thetas)
    return Benchmark(type(robot).__name__, tile_goals(reached, robot.outcomes, side, rng), side)


def last_row(times: Array, trajectory: Array) -> Array:
    """The correspondence of a toy: a demonstration of it is theta itself."""
    return trajectory[-1]


def toy_demonstrations(robot: Toy) -> list[Demonstration]:
    """Movements in contexts all over C, each to another place that uniform movements reach; always the same ones."""
    rng = stream(0, "demonstrations by a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((REACHING, robot.policies.dim))
    found = []
    for place in rng.integers(REACHING, size=SHOWN):
        context = robot.contexts.sample(rng)
        outcomes = robot.effect(np.tile(context, (REACHING, 1)), thetas)
        if robot.outcomes.contains(outcomes[place]):
            found.append(Demonstration(context, np.array([0.0, 1.0]), np.tile(thetas[place], (2, 1)), outcomes[place]))
    return found


def arm_benchmark(arm: PlanarArm) -> Benchmark:
    """One random goal in each tile of T, without those that the arm cannot reach; always the same ones."""
    box = arm.outcomes
    goals = tile_goals(_grid(box, SIDE), box, SIDE, stream(0, "goals for an arm"), at_least=1)
    return Benchmark(type(arm).__name__, goals[arm.reachable(goals)], SIDE)


def arm_demonstrations(arm: PlanarArm) -> list[Demonstration]:
    """Movements from rest to postures with all bends equal; their end positions are spread evenly within reach."""
    shares = (np.arange(SHOWN) + 0.5) / SHOWN  # of the area within reach: a sunflower's spiral
    radii = np.sqrt(arm.min_radius**2 + shares * (arm.length**2 - arm.min_radius**2))
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(SHOWN)
    ends = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return [_led_to(arm, end) for end in ends]


def goals_all_over(environment: Environment) -> Benchmark:
    """At most 500 goals over T, for a task that has none: a grid in one or two dimensions, Sobol points above."""
    box = environment.outcomes
    per_side = int(MOST_GOALS ** (1 / box.dim))
    if box.dim <= 2:
        steps = (np.arange(per_side) + 0.5) / per_side
        points = np.stack(np.meshgrid(*[steps] * box.dim), axis=-1).reshape(-1, box.dim)
    else:
        from scipy.stats import qmc  # takes longer to import than this whole library

        points = qmc.Sobol(box.dim, scramble=False).random_base2(int(np.log2(MOST_GOALS)))[1:]
    return Benchmark(type(environment).__name__, box.low + points * box.sides, float(box.sides.max()) / per_side)


def benchmark_of(task: Task, file: Path | None) -> tuple[Benchmark, list[str], str | None]:
    """The goals of a run, messages on them, and the checksum of their file, None of goals that are made.

    Args:
        task: has the goals if there is no file.
        file: replaces them.

    Raises:
        ValueError: they do not fit the environment, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot, notes, crc32 = file or task.benchmark, task.environment, list[str](), None
    if isinstance(source, Path):
        crc32 = _checksum("benchmark", source)
        benchmark = load_benchmark(source)
    elif source is not None:
        benchmark = source()
    else:
        benchmark = goals_all_over(robot)
        notes.append(
            f"{type(robot).__name__} has no benchmark goals: evaluations use {len(benchmark.goals)} points all over T, "
            "also where it cannot reach; sgimd benchmark makes goals from runs for --benchmark; a Task may have its own"
        )
    benchmark.check(robot)
    return benchmark, notes, crc32


def demonstrations_of(task: Task, file: Path | None) -> tuple[Sequence[Demonstration], list[str], str | None]:
    """What a teacher can show, messages on how well it fits the robot, and the checksum of the file.

    Args:
        task: has the demonstrations if there is no file.
        file: replaces them.

    Raises:
        ValueError: there are none, or one cannot be translated, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot = file or task.demonstrations, task.environment
    if source is None:
        raise ValueError(
            f"{type(robot).__name__} comes without demonstrations, and this algorithm needs a teacher; "
            "give --demonstrations FILE, or choose one that learns alone: --algorithm practice"
        )
    if not isinstance(source, Path):
        made = source()
        return made, _fit(robot, made, [0.0] * len(made)), None
    crc32 = _checksum("demonstrations", source)
    found = load_demonstrations(
        source, n_joints=task.n_joints, outcome_dim=robot.outcomes.dim, context_dim=robot.contexts.dim
    )
    misfits: list[float] = []
    for row, demonstration in enumerate(found):
        try:
            if task.misfit is None:
                correspondence_of(task)(demonstration.times, demonstration.trajectory)
            misfits.append(0.0 if task.misfit is None else task.misfit(demonstration))
        except ValueError as error:
            raise ValueError(f"{source}: recording {row} cannot be translated: {error}") from error
    return found, _fit(robot, found, misfits), crc32


def _fit(robot: Environment, shown: Sequence[Demonstration], misfits: Sequence[float]) -> list[str]:
    """How well the robot can play what it will be shown, and what lands outside T."""
    if not shown:
        return []
    size = f"{np.median(misfits):.4f} rad (median), {max(misfits):.4f} rad at most"
    notes = [f"{len(shown)} demonstrations; correspondence misses them by {size}"]
    outside = [row for row, each in enumerate(shown) if not robot.outcomes.contains(each.outcome)]
    if outside:
        place = ", ".join(f"{x:g}" for x in shown[outside[0]].outcome)
        more = f", as do {len(outside) - 1} more" if len(outside) > 1 else ""
        notes.append(f"recording {outside[0]} lands at ({place}) m, outside T{more}; were they recorded in cm?")
    return notes


def correspondence_of(task: Task) -> Correspondence:
    """From a demonstrated trajectory to theta.

    Raises:
        ValueError: neither the task nor its environment has one.
    """
    found = task.correspondence or getattr(task.environment, "correspondence", None)
    if found is None:
        raise ValueError(
            f"{type(task.environment).__name__} has no correspondence, so demonstrations cannot be translated; give it "
            "a method correspondence(times, trajectory) -> theta, or return Task(environment, correspondence=...)"
        )
    return found


def hand_led_of(task: Task) -> HandLed:
    """What a person can lead by the hand to teach this task.

    Raises:
        ValueError: neither the task nor its environment has it, or nothing translates what is led.
    """
    found = task.hand_led or getattr(task.environment, "hand_led", None)
    if not isinstance(found, HandLed):
        raise ValueError(
            f"{type(task.environment).__name__} cannot be led by the hand: it does not say which joints of which model "
            "a hand moves; give it an attribute hand_led, a HandLed(model, joints, hand) with a MuJoCo model (see "
            "sgimd_torch.environments.protocol), or return Task(environment, hand_led=...)"
        )
    correspondence_of(task)
    return found


def _in_context_zero(context_dim: int) -> list[Demonstration]:
    """The shipped demonstrations, for a rod with contexts."""
    return [replace(shown, context=np.zeros(context_dim)) for shown in load_demonstrations()]


def _misfit(rod: FishingRod, demonstration: Demonstration) -> float:
    times, trajectory = demonstration.times, demonstration.trajectory
    duration, (shortest, longest) = times[-1] - times[0], rod.primitive.durations
    if not shortest / STRETCH <= duration <= longest * STRETCH:
        raise ValueError(
            f"it lasts {duration:g} s, the robot's movements {shortest:g} to {longest:g} s; "
            "was it recorded in milliseconds?"
        )
    residual = rod.primitive.residual(rod.primitive.correspondence(times, trajectory), times, trajectory)
    if residual > MISFIT:
        raise ValueError(
            f"it is {residual:.2f} rad (root mean square) away from anything that the robot can play; "
            "was it recorded in degrees, or with the joints in another order?"
        )
    return residual


def _grid(box: Box, side: float) -> Array:
    """``(n, dim)``, the middles of tiles."""
    middles = [np.arange(low + side / 2, high, side) for low, high in zip(box.low, box.high, strict=True)]
    return np.stack(np.meshgrid(*middles), axis=-1).reshape(-1, box.dim)


def _led_to(arm: PlanarArm, end: Array) -> Demonstration:
    context = np.empty(0)
    theta = arm.solve(context, end)
    times = np.linspace(0.0, 1.0, SAMPLES)
    outcome = arm.execute(context, theta, stream(0, "demonstrations by an arm"))
    return Demonstration(context, times, np.outer(times, arm.angles(theta)), outcome)


def _checksum(what: str, path: Path) -> str:
    """Of the content of a file that the user named."""
    if path.is_dir():
        raise IsADirectoryError(f"{what}: {path} is a directory, a file was wanted")
    if not path.is_file():
        raise FileNotFoundError(f"{what}: there is no file {path}")
    return checksum(path)
