"""Film what a run has learnt: the robot moves for chosen goals, with the movements that the run's own memory infers.

Each goal is answered by the run's inverse model, its memory rebuilt from the log, in the middle of C, and executed once
with noise. Of the rod: a yellow ring is the goal, white dots are past landings, circles are half a metre and a metre
around the base. If the float has not met the water after the movement, the line is let out and the float falls; the
film says so. Planar arms, and environments of your own with record(context, theta, rng) -> Sketch, are drawn in the
plane.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from sgimd_torch.environments.protocol import Sketch
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import Run, config_of, read_run
from sgimd_torch.spaces import Array, stream
from sgimd_torch.strategies import Remember
from sgimd_torch.views.film.reel import Filming, Shot, count_frames, landed, shoot, write_film, write_sheet
from sgimd_torch.views.film.sketch import Sketchbook, in_picture

AFTER = (100, 500, 1000, 5000)
EXAMPLES = """examples:
  sgimd film runs/sgim-d/seed-003                               six goals all around, into runs/sgim-d/seed-003.mp4
  sgimd film runs/sgim-d/seed-003 --goals 0.3,0.6 -0.5,0.4      these two
  sgimd film runs/sgim-d/seed-003 --time-lapse                  each goal after 100, 500, 1000 and 5000 movements
  sgimd film runs/sgim-d/seed-003 --time-lapse --after 50,200   after 50 and 200
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
    stages = _stages(run, options)
    width = options.width or (480 if len(stages) > 1 else 640)
    size = {"width": width, "height": width * 3 // 4}
    shots = _cast(run, parts, goals, stages, say_movements=len(stages) > 1)
    with _camera(parts.environment, shots, size) as camera:
        _film(options, camera, [[stage[k] for stage in shots] for k in range(len(goals))])
    for movements, stage in zip(stages, shots, strict=True):
        missed = np.array([shot.missed for shot in stage])
        print(f"after {movements} movements: mean distance to the goal {missed.mean():.3f}, at most {missed.max():.3f}")
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
        return build(config_of(run), run.path)
    except (ImportError, AttributeError, RuntimeError) as error:
        if problem is None:
            raise
        asked = os.environ.get("MUJOCO_GL")
        slip = "set MUJOCO_GL=egl, or unset it"
        raise ImportError(f"MUJOCO_GL={asked} does not work here ({problem}); {slip}") from error


def _camera(robot: Any, scenes: Sequence[Sequence[Shot]], size: dict[str, int]) -> AbstractContextManager[Filming]:
    """What draws these shots."""
    shots = [shot for scene in scenes for shot in scene]
    if isinstance(shots[0].recording, Sketch):
        return nullcontext(Sketchbook(robot.outcomes, shots, **size))
    from sgimd_torch.views.film.camera import Camera  # only the rod needs OpenGL

    return Camera(robot.model, **size)


def remember(run: Run, parts: RunParts, start: int, stop: int) -> None:
    """Add to the memory of ``parts`` what the learner remembered in movements ``start`` to ``stop``, in the same order,
    and train a forward model on it as in the run."""
    memory, correspondence = parts.learner.memory, parts.learner.correspondence
    by_observation = isinstance(parts.learner.social, Remember)  # other learners remember only their own movements
    for row in range(start, min(stop, len(run.index))):
        if by_observation and correspondence is not None and run.demonstration[row] >= 0:
            shown = parts.demonstrations[run.demonstration[row]]
            memory.add(shown.context, correspondence(shown.times, shown.trajectory), shown.outcome)
        if run.origin[row]:
            memory.add(run.contexts[row], run.thetas[row], run.outcomes[row])
        if parts.model is not None:
            goal = run.goals[row]
            parts.model.refresh(memory, goal if np.isfinite(goal).all() else None)


def _cast(run: Run, parts: RunParts, goals: Array, stages: Sequence[int], *, say_movements: bool) -> list[list[Shot]]:
    """For each stage, the run's answer to each goal; a goal has the same motor noise at every stage."""
    shots = []
    assert parts.record is not None
    robot: Any = parts.environment
    context = (robot.contexts.low + robot.contexts.high) / 2
    title = f"{run.config['name'] or run.config['algorithm']}, seed {run.config['seed']}"
    for before, movements in zip((0, *stages), stages, strict=False):
        remember(run, parts, before, movements)
        if not len(parts.learner.memory):
            raise RunError(f"{run.path} remembers nothing after {movements} movements, so no movement can be inferred")
        past = run.outcomes[:movements]
        past = past[np.isfinite(past[:, 0])]
        stage = []
        for k, goal in enumerate(goals):
            theta = parts.inverse(context, goal).theta
            recording = parts.record(context, theta, stream(run.config["seed"], "film", k))
            shown = f"after {movements} movements" if say_movements else f"{title}, after {movements} movements"
            stage.append(Shot(recording, goal, shown, past))
        shots.append(stage)
    return shots


def _film(options: argparse.Namespace, camera: Filming, scenes: list[list[Shot]]) -> None:
    # tqdm shows the time left; without a terminal it prints a line now and then
    interval = 0.2 if sys.stderr.isatty() else 10.0
    frames = shoot(camera, scenes)
    write_film(options.out, tqdm(frames, "filming", count_frames(scenes), unit=" frames", mininterval=interval))
    if options.sheet is not None:
        write_sheet(options.sheet, [landed(camera, shots) for shots in scenes])


def _stages(run: Run, options: argparse.Namespace) -> list[int]:
    """After how many movements to film."""
    lived = len(run.index)
    if not lived:
        raise RunError(f"{run.path} has no movements yet; --resume goes on with it")
    if not options.time_lapse:
        return [lived]
    if options.after is None:
        return [*(movements for movements in AFTER if movements < lived), lived][: len(AFTER)]
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
        help="in the unit of T, m; without it, six of the benchmark's, all around",
    )
    parser.add_argument("--time-lapse", action="store_true", help="movements for each goal, early and late, tiled")
    parser.add_argument(
        "--after",
        type=_counts,
        metavar="N,N",
        help=f"movements, of a time lapse (default: {','.join(map(str, AFTER))})",
    )
    parser.add_argument("--width", type=_width, help="of a picture, pixels (default: 640; in a time lapse 480)")
    parser.add_argument("--out", type=Path, help="the film, .mp4 (default: next to the run's directory)")
    parser.add_argument("--sheet", type=Path, help="also an image of how each scene ends, .png")
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    # A minus with a number after it begins a goal, not an option.
    given = sys.argv[1:] if argv is None else argv
    words = [f" {word}" if re.match(r"-[.\d]", word) else word for word in given]
    options = parser().parse_args(words)
    if options.after and not options.time_lapse:
        parser().error("--after belongs to --time-lapse")
    for path, suffix in ((options.out, ".mp4"), (options.sheet, ".png")):
        if path is not None and (path.suffix != suffix or path.is_dir() or not path.parent.is_dir()):
            parser().error(f"must be a {suffix} file in a folder that exists, got {path}")
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
