"""Film what a run has learnt: the robot moves for chosen goals, with the movements that the run's own memory infers.

Each goal is answered by the run's inverse model, its memory rebuilt from the record, and executed once with noise;
where there are contexts, in the middle of their range. A yellow ring is the goal, white dots are past landings; of the
rod, circles are half a metre and a metre around the base. If the float has not met the water after the movement, the
line is let out and the float falls; the film says so. Beside it: each goal of the benchmark, coloured by how far its
answer misses it, and how the mean error has fallen. Planar arms, and environments of your own with
trace(context, theta, rng) -> Sketch, are drawn in the plane; a red cross is the outcome, in the plane of the goals.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from sgimd_torch.environments.protocol import Sketch
from sgimd_torch.evaluation import evaluate
from sgimd_torch.figures.names import colour, label
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.read import Run, config_of, read_run
from sgimd_torch.spaces import Array, stream
from sgimd_torch.strategies import Remember
from sgimd_torch.views.film.panel import panel
from sgimd_torch.views.film.reel import RATES, Shot, shoot, write_film
from sgimd_torch.views.film.sketch import Sketchbook

EXAMPLES = """examples:
  sgimd film runs/sgim-d/seed-003                               six goals, into runs/sgim-d/seed-003.mp4
  sgimd film runs/sgim-d/seed-003 --goals 0.3,0.6 -0.5,0.4      these two
  sgimd film runs/sgim-d/seed-003 --after 30 300 3000           how it learns: two goals, early and late
  sgimd film runs/sgim-d/seed-003 --out film.webp               a moving picture, for a page
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Make the film; returns 0.

    Raises:
        ValueError, OSError, ImportError: the request is wrong, or there is nothing to draw with.
    """
    options = _options(argv)
    run = read_run(options.run)
    parts = _parts(run, trust=options.trust)
    if parts.task.picture is None:
        raise ValueError(
            f"{run.path} is of {run.config['environment']}, which cannot be filmed: it brings no picture of its "
            "movements, a method trace(context, theta, rng) -> Sketch"
        )
    if options.goals is None:
        known = np.unique(parts.benchmark.goals, axis=0)
        goals = known[np.linspace(0, len(known) - 1, 2 if options.after else 6).round().astype(int)]
    else:
        hint = "a goal is a place in T, such as 0.3,0.6"
        goals = np.stack([parts.environment.outcomes.check("--goals", goal, hint) for goal in options.goals])
    stages = _stages(run, options)
    shots = _cast(run, parts, goals, stages)
    with _camera(parts.environment, shots) as camera:
        rate = RATES[options.out.suffix]
        n = sum(len(shot.moments(rate)) for shot in shots)
        write_film(options.out, tqdm(shoot(camera.frame, shots, rate), "filming", n, unit=" frames", delay=1.0))
    amount, missed = parts.environment.outcomes.amount, np.reshape([shot.missed for shot in shots], (len(stages), -1))
    for movements, each in zip(stages, missed, strict=True):
        mean, most = amount(each.mean()), amount(each.max())
        print(f"after {movements} movements: mean distance to the goal {mean}, at most {most}")
    print(f"Film {options.out}")
    return 0


def _parts(run: Run, *, trust: bool) -> RunParts:
    """What made the run. MuJoCo chooses how to draw when it is imported, and may fail then; arms do without it."""
    if sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "egl")  # draws without a display
    try:
        return build(config_of(run, trust=trust))
    except (AttributeError, RuntimeError) as error:  # each kind of OpenGL fails in its own way
        if "mujoco" in sys.modules:
            raise
        asked = os.environ.get("MUJOCO_GL")
        raise ImportError(f"MUJOCO_GL={asked} does not work ({error}); set MUJOCO_GL=egl, or unset it") from error


def _camera(robot: Any, shots: Sequence[Shot]) -> AbstractContextManager[Any]:
    """What draws these shots."""
    if isinstance(shots[0].recording, Sketch):
        return nullcontext(Sketchbook(robot.outcomes, shots))
    from sgimd_torch.views.film.camera import Camera  # only the rod needs OpenGL

    return Camera(robot.model)


def _cast(run: Run, parts: RunParts, goals: Array, stages: Sequence[int]) -> list[Shot]:
    """For each stage the run's answer to each goal, which has the same motor noise at every stage. Beside it: how far
    the goals of the benchmark are missed in the same context, and the curve of the mean error over the stages; in a
    film of one stage, that of the run's own evaluations."""
    picture = parts.task.picture
    assert picture is not None
    robot, seed = parts.environment, run.config["seed"]
    context = (robot.contexts.low + robot.contexts.high) / 2
    who = label(run.config["name"] or run.config["algorithm"])
    shots, errors = list[Shot](), list[Array]()
    for before, movements in zip((0, *stages), stages, strict=False):
        remember(run, parts, before, movements)
        if not len(parts.learner.memory):
            raise ValueError(f"{run.path} remembers nothing after {movements} movements, so it infers no movement")
        past = run.outcomes[:movements]
        past = past[np.isfinite(past[:, 0])]
        title = f"{who}, seed {seed}, after {movements} movements"
        for k, goal in enumerate(goals):
            recording = picture(context, parts.answers["own"](context, goal).theta, stream(seed, "film", k))
            shots.append(Shot(recording, goal, title, robot.outcomes.unit, past))
        found = evaluate(
            parts.answers["own"], robot, parts.benchmark.goals, seed, movements, context=context, repeats=0
        )
        errors.append(found.errors)
    curve = np.array(stages), np.array([each.mean() for each in errors])
    if len(stages) == 1 and len(run.evaluation["movements"]):
        curve = run.evaluation["movements"], run.evaluation["mean_error"]
    ink, goals_there = colour(run.config["algorithm"]), parts.benchmark.goals
    beside = [panel(robot.outcomes, goals_there, errors[k], at, curve, ink) for k, at in enumerate(stages)]
    return [replace(shot, beside=beside[row // len(goals)]) for row, shot in enumerate(shots)]


def remember(run: Run, parts: RunParts, start: int, stop: int) -> None:
    """Add to the memory of ``parts`` what the learner remembered in movements ``start`` to ``stop``, in the same order,
    and train a forward model on it as in the run."""
    memory, correspondence = parts.learner.memory, parts.learner.correspondence
    by_observation = isinstance(parts.learner.social, Remember)  # other learners remember only their own movements
    for row in range(start, min(stop, len(run.index))):
        if by_observation and correspondence is not None and run.demonstration[row] >= 0:
            shown = run.demonstrations[run.demonstration[row]]
            memory.add(shown.context, correspondence(shown.times, shown.trajectory), shown.outcome)
        if np.isfinite(run.outcomes[row]).all():
            memory.add(run.contexts[row], run.thetas[row], run.outcomes[row])
        for model in parts.learner.problem.trained:
            goal = run.goals[row]
            model.refresh(memory, goal if np.isfinite(goal).all() else None)


def _stages(run: Run, options: argparse.Namespace) -> list[int]:
    """After how many movements to film."""
    lived = len(run.index)
    if not lived:
        raise ValueError(f"{run.path} has no movements yet; --resume goes on with it")
    if options.after is None:
        return [lived]
    if not 1 <= min(options.after) <= max(options.after) <= lived:
        raise ValueError(f"--after must be from 1 to {lived}, the movements of {run.path}, got {options.after}")
    return sorted(set(options.after))


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd film``."""
    parser = argparse.ArgumentParser(
        prog="sgimd film",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("run", type=Path, help="a run's directory: OUT/NAME/seed-003")
    goals = "in the task space; without it, six of the benchmark's, or two with --after"
    parser.add_argument("--goals", type=numbers, nargs="+", metavar="X,Y", help=goals)
    after = "movements; the goals again and again (default: once, after all movements)"
    parser.add_argument("--after", type=int, nargs="+", metavar="N", help=after)
    parser.add_argument("--trust", action="store_true", help="execute code that the run's settings name")
    parser.add_argument("--out", type=Path, help="the film, .mp4 or .webp (default: .mp4 next to the run's directory)")
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    # A minus with a number after it begins a goal, not an option.
    given = sys.argv[1:] if argv is None else argv
    options = parser().parse_args([f" {word}" if re.match(r"-[.\d]", word) else word for word in given])
    if options.out is None:
        options.out = Path(f"{options.run.resolve()}.mp4")
    elif options.out.suffix not in RATES or not options.out.parent.is_dir():
        parser().error(f"--out must be a {' or '.join(RATES)} file in a folder that exists, got {options.out}")
    return options


def numbers(text: str) -> list[float]:
    """A goal of the command line, such as "0.3,0.6"; argparse names this function where it fails."""
    return [float(word) for word in text.split(",")]
