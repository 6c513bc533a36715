"""Film what a run has learnt: the robot executes the movements that the inverse model of the run infers for goals.

The learner repeats its record. The robot executes the movement inferred for each goal once, with motor noise, in one
context. Goals are yellow, dots are past outcomes, and lines are paths. A panel shows the benchmark goals, coloured by
error, and the curve of the mean error.

MuJoCo draws robots from model files, with the border of T, and the fishing rod, with circles of radius 0.5 m and 1 m
around its base. If the float is still in the air after the movement, the line is let out and the float falls, as the
caption says. Planar arms, and your own environments with a method trace(context, theta, rng) -> Sketch, are drawn in
the plane; so are robots from model files if there is no OpenGL.
"""

from __future__ import annotations

import argparse
import importlib
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

from sgimd_torch.environments.protocol import beside_execute
from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.evaluation import evaluate
from sgimd_torch.extras.film.reel import RATES, Painter, Shot, check_film, shoot, write_film
from sgimd_torch.extras.film.sketch import Sketchbook, panel
from sgimd_torch.extras.film.traced import traced
from sgimd_torch.extras.table.names import colour, label
from sgimd_torch.runs.load import OpenRun
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import parser_of
from sgimd_torch.runs.read import Run
from sgimd_torch.spaces import Array, stream

EXAMPLES = """examples:
  sgimd film runs/sgim-d/seed-003                               six goals, into runs/sgim-d/seed-003.mp4
  sgimd film runs/sgim-d/seed-003 --goals 0.3,0.6 -0.5,0.4      two chosen goals
  sgimd film runs/sgim-d/seed-003 --after 30 300 3000           two goals, early and late in learning
  sgimd film runs/sgim-d/seed-003 --out film.webp               an animated picture, for a page
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Make the film and return the exit code 0.

    Raises:
        ValueError, OSError: the request is wrong.
        ImportError: a library to draw with is missing.
    """
    options = _options(argv)
    run = _opened(options.run, trust=options.trust)
    recorded, parts = run.recorded, run.parts
    if not beside_execute(parts.environment, "trace"):
        raise ValueError(
            f"{recorded.path} is of {recorded.config['environment']}, which cannot be filmed: it needs a method "
            "trace(context, theta, rng) -> Sketch, in the class that has its execute()"
        )
    if options.goals is None:
        known = np.unique(parts.benchmark.goals, axis=0)
        goals = known[np.linspace(0, len(known) - 1, 2 if options.after else 6).round().astype(int)]
    else:
        hint = "a goal is a place in T, such as 0.3,0.6"
        goals = np.stack([parts.environment.outcomes.check("--goals", goal, hint) for goal in options.goals])
    stages, contexts = _stages(recorded, options), parts.environment.contexts
    middle = (contexts.low + contexts.high) / 2
    context = contexts.check("--context", middle if options.context is None else options.context)
    check_film(options.out)
    policies = parts.environment.policies
    recording = traced(parts.environment, context, (policies.low + policies.high) / 2, stream(0, "film"))
    if not isinstance(recording, Sketch):  # a sketch can be drawn without OpenGL
        with _painter(parts.environment, [Shot(recording, goals[0])]):
            pass
    shots, stages = _cast(run, goals, context, stages)
    with _painter(parts.environment, shots) as painter:
        rate = RATES[options.out.suffix]
        n = sum(len(shot.moments(rate)) for shot in shots)
        write_film(
            options.out, tqdm(shoot(painter, shots, rate), "filming", n, unit=" frames", delay=1.0, disable=None)
        )
    amount, missed = parts.environment.outcomes.amount, np.reshape([shot.missed for shot in shots], (len(stages), -1))
    for movements, distances in zip(stages, missed, strict=True):
        mean, most = amount(distances.mean()), amount(distances.max())
        print(f"after {movements} movements: mean distance to the goal {mean}, at most {most}")
    print(f"Film {options.out}")
    return 0


def _opened(path: Path, *, trust: bool) -> OpenRun:
    """The run. MuJoCo chooses OpenGL when it is imported; if the choice fails, it is imported without."""
    if sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "egl")  # works without a display
    asked = dict(os.environ)
    try:
        importlib.import_module("mujoco")
    except (AttributeError, RuntimeError, ImportError):  # each OpenGL library fails in a different way
        os.environ["MUJOCO_GL"] = "disable"
        importlib.import_module("mujoco")
        os.environ.update(asked)
    return OpenRun(path, trust=trust)


def _painter(robot: Any, shots: Sequence[Shot]) -> AbstractContextManager[Painter]:
    """The painter for a robot and its shots."""
    sketched = isinstance(shots[0].recording, Sketch)
    if not sketched or hasattr(shots[0].recording, "states"):
        from sgimd_torch.extras.film.camera import Camera  # only these need OpenGL
        from sgimd_torch.extras.film.model_camera import ModelCamera

        try:
            return ModelCamera(robot, shots) if sketched else Camera(robot.model)
        except ImportError as error:
            if not sketched:
                raise
            say(f"drawn in the plane: {error}")
    return nullcontext(Sketchbook(robot.outcomes, shots))


def _cast(run: OpenRun, goals: Array, context: Array, stages: Sequence[int]) -> tuple[list[Shot], list[int]]:
    """The shots, and the number of movements of the learner at each stage.

    At each stage there is a shot of the movement inferred for each goal in a context, with equal motor noise at all
    stages. The panel beside it shows the errors of the benchmark goals at this stage, and the curve of the mean error
    over all stages. If there is one stage, the curve has the evaluations of the run.

    Args:
        run: opened run; its learner has the memory of each stage in turn.
        goals: ``(n, outcome_dim)`` goals to film.
        context: ``(context_dim,)`` context of all movements.
        stages: numbers of movements; robots that move at once end the last movements together, so there may be more.
    """
    recorded, parts = run.recorded, run.parts
    robot, benchmark = parts.environment, parts.benchmark
    config, seed = recorded.config, recorded.config["seed"]
    names = robot.contexts.names or [f"context {k}" for k in range(robot.contexts.dim)]
    seen = ", ".join(f"{name} {robot.contexts.amount(x)}" for name, x in zip(names, context, strict=True))
    who = label(config["name"] or config["algorithm"])
    shots, reached, errors = list[Shot](), list[int](), list[Array]()
    for stage in stages:
        run.recall(stage)
        inverse, movements = parts.learner.inverse, parts.learner.movements
        if not len(parts.learner.memory):
            raise ValueError(
                f"{recorded.path} has an empty memory after {movements} movements, so it infers no movement"
            )
        past = recorded.outcomes[:movements]
        past = past[np.isfinite(past[:, 0])]
        title = f"{who}, seed {seed}, after {movements} movements" + f"\n{seen}" * bool(seen)
        for k, goal in enumerate(goals):
            recording = traced(robot, context, inverse(context, goal).theta, stream(seed, "film", k))
            shots.append(Shot(recording, goal, context, title, robot.outcomes.unit, past))
        evaluation = evaluate(inverse, robot, benchmark.goals, seed, movements, context=context, repeats=0)
        errors.append(evaluation.errors)
        reached.append(movements)
    curve = np.array(reached), np.array([errors_of_stage.mean() for errors_of_stage in errors])
    if len(reached) == 1 and len(recorded.evaluation["movements"]):
        curve = recorded.evaluation["movements"], recorded.evaluation["mean_error"]
    ink = colour(config["algorithm"])
    beside = [panel(robot.outcomes, benchmark.goals, errors[k], at, curve, ink) for k, at in enumerate(reached)]
    return [replace(shot, beside=beside[row // len(goals)]) for row, shot in enumerate(shots)], reached


def _stages(run: Run, options: argparse.Namespace) -> list[int]:
    """The numbers of movements of the learner after which to film."""
    lived = len(run.index)
    if not lived:
        raise ValueError(f"{run.path} has no movements yet; continue the run with --resume")
    if options.after is None:
        return [lived]
    if not 1 <= min(options.after) <= max(options.after) <= lived:
        raise ValueError(f"--after must be from 1 to {lived}, the length of {run.path}, got {options.after}")
    return sorted(set(options.after))


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd film``."""
    parser = parser_of("film", __doc__, epilog=EXAMPLES)
    parser.add_argument("run", type=Path, help="directory of a run: OUT/NAME/seed-003")
    goals = "points of T (default: six goals of the benchmark, or two if --after is given)"
    parser.add_argument("--goals", type="numbers", nargs="+", metavar="X,Y", help=goals)
    where = "context of all movements (default: the middle of C)"
    parser.add_argument("--context", type="numbers", metavar="X,Y", help=where)
    after = "numbers of movements after which to film all goals (default: all movements)"
    parser.add_argument("--after", type=int, nargs="+", metavar="N", help=after)
    parser.add_argument(
        "--trust", action="store_true", help="execute the user's code that the settings of the run name"
    )
    parser.add_argument("--out", type=Path, help="film to write, .mp4 or .webp (default: .mp4 next to the run)")
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    # A word that begins with a minus and a digit is a goal, not an option; argparse takes it so after a space.
    given = sys.argv[1:] if argv is None else argv
    options = parser().parse_args([f" {word}" if re.match(r"-[.\d]", word) else word for word in given])
    if options.out is None:
        options.out = Path(f"{options.run.resolve()}.mp4")
    elif options.out.suffix not in RATES or not options.out.parent.is_dir():
        parser().error(f"--out must be a {' or '.join(RATES)} file in a folder that exists, got {options.out}")
    return options
