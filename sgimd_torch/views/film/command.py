"""Film what a run has learnt: the robot moves for chosen goals, with the movements that the run's own memory infers.

Each goal is answered by the run's inverse model, its memory rebuilt from the log, and executed once with noise; where
there are contexts, in the middle of their range. A yellow ring is the goal, white dots are past landings; of the rod,
circles are half a metre and a metre around the base. If the float has not met the water after the movement, the line is
let out and the float falls; the film says so. Beside it: each goal of the benchmark, the bluer the nearer its answer
lands, what teachers have shown when they were asked, and how the mean error has fallen. Planar arms, and environments
of your own with record(context, theta, rng) -> Sketch, are drawn in the plane.
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

from sgimd_torch.catalogue import colour
from sgimd_torch.environments.protocol import Sketch
from sgimd_torch.evaluation import evaluate
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import Run, config_of, points_of, read_run
from sgimd_torch.spaces import Array, stream
from sgimd_torch.views.film.panel import Panel, Stage
from sgimd_torch.views.film.reel import RATES, Filming, Shot, count_frames, shoot, write_film, write_sheet
from sgimd_torch.views.film.sketch import Sketchbook, in_picture
from sgimd_torch.views.memories import remember

AFTER = (30, 100, 300, 1000, 3000)
EXAMPLES = """examples:
  sgimd film runs/sgim-d/seed-003                               six goals all around, into runs/sgim-d/seed-003.mp4
  sgimd film runs/sgim-d/seed-003 --goals 0.3,0.6 -0.5,0.4      these two
  sgimd film runs/sgim-d/seed-003 --time-lapse                  how it learns: two goals, early and late
  sgimd film runs/sgim-d/seed-003 --time-lapse --after 50,200   after 50 and 200 movements
  sgimd film runs/sgim-d/seed-003 --time-lapse --out film.webp  a moving picture, for a page
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Make the film; returns 0.

    Raises:
        ValueError, OSError, ImportError: the request is wrong, or there is nothing to draw with.
    """
    options = _options(argv)
    run = read_run(options.run)
    parts = _parts(run)
    if parts.record is None:
        raise RunError(
            f"{run.path} is of {run.config['environment']}, which cannot be filmed: it brings no picture of its "
            "movements, a method record(context, theta, rng) -> Sketch"
        )
    goals = _goals(options.goals, parts)
    if options.time_lapse and options.goals is None:
        goals = goals[::3]
    stages = _stages(run, options)
    size = {"width": options.width, "height": options.width * 3 // 4}
    shots, found = _cast(run, parts, goals, stages)
    with _camera(parts.environment, shots, size) as camera:
        _film(options, camera, _with_panels(run, parts, shots, found, size["height"]))
    for k, stage in enumerate(found):
        missed = np.array([shot.missed for shot in shots[k * len(goals) : (k + 1) * len(goals)]])
        print(
            f"after {stage.movements} movements: mean distance to the goal {missed.mean():.3f}, at most "
            f"{missed.max():.3f}; to {len(stage.errors)} goals of the benchmark {stage.errors.mean():.3f}"
        )
    print(f"Film {options.out}" + (f", sheet {options.sheet}" if options.sheet else ""))
    return 0


def _parts(run: Run) -> RunParts:
    """What made the run. MuJoCo chooses how to draw when it is imported, and may fail then; arms do without it."""
    if "mujoco" not in sys.modules and sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "egl")  # draws without a display
    problem: Exception | None = None
    try:
        import mujoco  # noqa: F401
    except (ImportError, AttributeError, RuntimeError) as error:  # each kind of OpenGL fails in its own way
        problem = error
    try:
        return build(config_of(run))
    except (ImportError, AttributeError, RuntimeError) as error:
        if problem is None:
            raise
        asked = os.environ.get("MUJOCO_GL")
        slip = "set MUJOCO_GL=egl, or unset it"
        raise ImportError(f"MUJOCO_GL={asked} does not work here ({problem}); {slip}") from error


def _camera(robot: Any, shots: Sequence[Shot], size: dict[str, int]) -> AbstractContextManager[Filming]:
    """What draws these shots."""
    if isinstance(shots[0].recording, Sketch):
        return nullcontext(Sketchbook(robot.outcomes, shots, **size))
    from sgimd_torch.views.film.camera import Camera  # only the rod needs OpenGL

    return Camera(robot.model, **size)


def _cast(run: Run, parts: RunParts, goals: Array, stages: Sequence[int]) -> tuple[list[Shot], list[Stage]]:
    """For each stage, the run's answer to each goal, which has the same motor noise at every stage; and how far it
    misses the goals of the benchmark, in the same context."""
    shots, found = [], []
    assert parts.record is not None
    robot: Any = parts.environment
    context = (robot.contexts.low + robot.contexts.high) / 2
    known = np.empty((0, 2))
    title = f"{run.config['name'] or run.config['algorithm']}, seed {run.config['seed']}"
    for before, movements in zip((0, *stages), stages, strict=False):
        remember(run, parts, before, movements)
        if not len(parts.learner.memory):
            raise RunError(f"{run.path} remembers nothing after {movements} movements, so no movement can be inferred")
        past = run.outcomes[:movements]
        past = past[np.isfinite(past[:, 0])]
        for k, goal in enumerate(goals):
            theta = parts.inverse(context, goal).theta
            recording = parts.record(context, theta, stream(run.config["seed"], "film", k))
            shots.append(Shot(recording, goal, f"{title}, after {movements} movements", past))
        if len(stages) > 1:  # the first shot of a stage begins with what was learnt since the last one
            shots[-len(goals)] = replace(shots[-len(goals)], new=int(len(past) - len(known)))
        known = past
        judged = evaluate(
            parts.inverse, robot, parts.benchmark.goals, run.config["seed"], movements, context=context, repeats=0
        )
        found.append(Stage(movements, judged.errors, _shown(run, movements)))
    return shots, found


def _shown(run: Run, movements: int) -> dict[str, Array]:
    """Teacher -> ``(n, outcome_dim)`` what they have shown before so many movements, because they were asked."""
    if run.requests is None:
        return {}
    got, teachers = points_of(run.requests, "got", run.outcomes.shape[1]), run.requests["teacher"]
    given = (run.requests["reply"] == "shown") & (run.requests["index"] < movements)
    return {name: got[given & (teachers == name)] for name in sorted(set(teachers.tolist()))}


def _with_panels(run: Run, parts: RunParts, shots: list[Shot], found: list[Stage], height: int) -> list[Shot]:
    """The shots with map and curve beside them. A film of one stage shows the curve of the run's own evaluations."""
    seen = run.evaluation["movements"], run.evaluation["mean_error_m"]
    curve = np.array(seen) if len(found) == 1 and len(seen[0]) else None
    shade = colour(run.config["algorithm"])
    panel = Panel(parts.benchmark.goals, found, shade, curve=curve, height=height)
    each = len(shots) // len(found)
    return [
        replace(shot, beside=panel.beside(row // each, shot.goal, shot.recording.outcome))
        for row, shot in enumerate(shots)
    ]


def _film(options: argparse.Namespace, camera: Filming, shots: list[Shot]) -> None:
    # tqdm shows the time left; without a terminal it prints a line now and then
    interval = 0.2 if sys.stderr.isatty() else 10.0
    rate = RATES[options.out.suffix]
    frames, n = shoot(camera, shots, rate), count_frames(shots, rate)
    write_film(options.out, tqdm(frames, "filming", n, unit=" frames", mininterval=interval))
    if options.sheet is not None:
        write_sheet(options.sheet, [camera.frame(shot, shot.recording.landed) for shot in shots])


def _stages(run: Run, options: argparse.Namespace) -> list[int]:
    """After how many movements to film."""
    lived = len(run.index)
    if not lived:
        raise RunError(f"{run.path} has no movements yet; --resume goes on with it")
    if not options.time_lapse:
        return [lived]
    if options.after is None:
        return [*(movements for movements in AFTER if movements < lived), lived]
    if max(options.after) > lived:
        raise RunError(f"--after must be at most {lived}, the movements of {run.path}, got {max(options.after)}")
    return sorted(set(options.after))


def _goals(given: list[list[float]] | None, parts: RunParts) -> Array:
    """``(n, outcome_dim)`` those of the command line, in T; else six of the benchmark's."""
    space = parts.environment.outcomes
    wrong = next((goal for goal in given or () if len(goal) != space.dim), None)
    if wrong is not None:
        numbers = ",".join(f"{x:g}" for x in wrong)
        raise ValueError(f"--goals must be {space.dim} number{'s' * (space.dim > 1)} each, got {numbers}")
    return space.check("goals", given or _spread(parts.benchmark.goals), "in the unit of T")


def _spread(goals: Array) -> Array:
    """``(6, outcome_dim)`` the goals nearest to six places all around, alternately far from the middle and nearer."""
    angles = np.radians(np.arange(30, 390, 60))
    places = np.array([1.0, 0.6] * 3)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = in_picture(goals)
    low, high = points.min(axis=0), points.max(axis=0)
    around = (points - (low + high) / 2) / np.where(low < high, (high - low) / 2, 1.0)
    nearest = [int(np.linalg.norm(around - place, axis=1).argmin()) for place in places]
    return goals[list(dict.fromkeys(nearest))]


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd film``."""
    parser = argparse.ArgumentParser(
        prog="sgimd film",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("run", type=Path, help="a run's directory: OUT/NAME/seed-003")
    parser.add_argument(
        "--goals",
        type=_goal,
        nargs="+",
        metavar="X,Y",
        help="in the task space (m); without it, six of the benchmark's, all around, of which a time lapse shows two",
    )
    parser.add_argument("--time-lapse", action="store_true", help="the goals again and again, early and late")
    parser.add_argument(
        "--after",
        type=_counts,
        metavar="N,N",
        help=f"movements, of a time lapse (default: {','.join(map(str, AFTER))})",
    )
    parser.add_argument(
        "--width", type=_width, default=640, help="of the robot's picture, pixels (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, help="the film, .mp4 or .webp (default: .mp4 next to the run's directory)")
    parser.add_argument("--sheet", type=Path, help="also an image of how each movement ends, .png")
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    # A minus with a number after it begins a goal, not an option.
    given = sys.argv[1:] if argv is None else argv
    words = [f" {word}" if re.match(r"-[.\d]", word) else word for word in given]
    options = parser().parse_args(words)
    if options.after and not options.time_lapse:
        parser().error("--after belongs to --time-lapse")
    for path, suffixes in ((options.out, tuple(RATES)), (options.sheet, (".png",))):
        if path is not None and (path.suffix not in suffixes or path.is_dir() or not path.parent.is_dir()):
            parser().error(f"must be a {' or '.join(suffixes)} file in a folder that exists, got {path}")
    if options.out is None:
        options.out = Path(f"{options.run.resolve()}{'-time-lapse' if options.time_lapse else ''}.mp4")
    return options


def _goal(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        wanted = "numbers such as 0.3,0.6, x and y in metres for the rod"
        raise argparse.ArgumentTypeError(f"must be {wanted}, got {text.strip()!r}") from None


def _counts(text: str) -> list[int]:
    try:
        counts = [int(word) for word in text.split(",")]
    except ValueError:
        counts = [0]
    if min(counts) < 1:
        raise argparse.ArgumentTypeError(f"must be whole numbers above 0 such as 100,500, got {text.strip()!r}")
    return counts


def _width(text: str) -> int:
    width = int(text) if text.isascii() and text.isdigit() else 0
    if width % 8 or not 160 <= width <= 1280:
        raise argparse.ArgumentTypeError(f"must be from 160 to 1280 in steps of 8, got {text!r}")
    return width
