"""Check demonstrations on a robot, or import them from other formats.

  check    prints a line for each recording: the recorded outcome (says), the outcome on the simulated robot (lands),
           the distance between these outcomes (apart), the distance from the recording to the movement that the robot
           plays (misfit), and the limits of the robot that the recording exceeds (remarks)
  import   converts recordings in CSV or in a LeRobot dataset (v3) to a file for sgimd run --demonstrations

SOURCE is an .npz file of save_demonstrations, a CSV file, a folder with a CSV file for each recording, or the folder of
a LeRobot dataset. For CSV and LeRobot, options name the columns. A column may be a vector, as in LeRobot:
observation.state is the whole vector, and observation.state[0:6] is its first six entries. The outcome is read in the
last row of a recording, and the context in its first row.

Examples:
  sgimd demonstrations check shown.npz --task fishing-rod
  sgimd demonstrations check recordings --task mypackage.toss:make --joints shoulder,elbow --outcome x,y
  sgimd demonstrations import datasets/my_arm --joints observation.state[0:6] --outcome observation.place[0:2]
      --time timestamp --recording episode_index --degrees --out shown.npz

Exit code: 0 all recordings can be used, 2 some cannot be used, or the request is wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.columns import Columns, read_csv
from sgimd_torch.demonstrations.fit import beyond_limits, misfit_of
from sgimd_torch.environments.protocol import SimulationError, execute_many
from sgimd_torch.runs.build import task_of
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.process import parser_of
from sgimd_torch.runs.tasks import Task
from sgimd_torch.runs.tasks.taught import correspondence_of
from sgimd_torch.spaces import Array, Demonstration, stream
from sgimd_torch.views.text_table import print_table

HEADS: Final = ("recording", "lasts (s)", "samples", "says", "lands", "apart", "misfit", "remarks")


@dataclass(frozen=True, eq=False)
class Checked:
    """A recording, checked on a robot.

    Attributes:
        shown: demonstration with the recording.
        lands: ``(outcome_dim,)`` outcome on the robot, None if the robot cannot use the recording.
        misfit: distance from the recording to the movement that the robot plays, NaN if unknown; see `misfit_of`.
        remarks: sentences, one for each limit of the robot that the recording exceeds.
        refused: reason why the robot cannot use the recording, "" if it can.
    """

    shown: Demonstration
    lands: Array | None
    misfit: float
    remarks: list[str]
    refused: str = ""

    @property
    def apart(self) -> float:
        """Distance from the recorded outcome to the outcome on the robot; NaN without an outcome on the robot."""
        return float("nan") if self.lands is None else float(np.linalg.norm(self.lands - self.shown.outcome))


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd demonstrations``."""
    source = argparse.ArgumentParser(add_help=False)
    source.add_argument("source", type=Path, metavar="SOURCE")
    for option, about in (("joints", "joint angles or commands"), ("outcome", "outcome"), ("context", "context")):
        source.add_argument(
            f"--{option}", type=_names, default=(), metavar="COLUMN,COLUMN", help=f"columns of the {about}"
        )
    source.add_argument("--time", metavar="COLUMN", help="column of times in s (default: time; in LeRobot timestamp)")
    source.add_argument(
        "--recording",
        metavar="COLUMN",
        help="column that divides a table into recordings (default: none; in LeRobot episode_index)",
    )
    source.add_argument("--degrees", action="store_true", help="convert joints from degrees to radians")
    shown: dict[str, Any] = {"description": __doc__, "formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = parser_of("demonstrations", __doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="check|import")
    checked = commands.add_parser("check", help="execute recordings on a robot", parents=[source], **shown)
    checked.add_argument(
        "--task",
        required=True,
        metavar="ENVIRONMENT",
        help="robot: a name or module:attribute, as for --environment of sgimd run",
    )
    imported = commands.add_parser(
        "import", help="convert recordings to a file for --demonstrations", parents=[source], **shown
    )
    imported.add_argument("--out", type=Path, required=True, metavar="FILE.npz", help="file to write")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Check or import demonstrations, and return the exit code 0.

    Raises:
        ValueError: the source cannot be read, or the robot cannot use some recordings.
        OSError: a file cannot be read or written.
    """
    options = parser().parse_args(argv)
    if options.command == "import" and options.out.suffix != ".npz":
        raise ValueError(f"--out must end in .npz, got {options.out}")
    shown = read(options)
    if options.command == "import":
        save_demonstrations(options.out, shown)
        print(f"{options.out}: {len(shown)} recordings, {shown[0].trajectory.shape[1]} joints")
        return 0
    task = task_of(Config(parts={"environment": options.task}))
    contexts = task.environment.contexts
    if contexts.dim and not shown[0].context.size:
        what = ", ".join(contexts.axis(k, "context") for k in range(contexts.dim))
        raise ValueError(f"{options.source} has no context ({what}); name its columns with --context")
    found = [check(task, each, row) for row, each in enumerate(shown)]
    print_table([HEADS, *(_cells(row, each) for row, each in enumerate(found))])
    apart = [each.apart for each in found if each.lands is not None]
    if apart:
        remarked = sum(bool(each.remarks) for each in found)
        print(
            f"{len(apart)} of {len(found)} can be used; they land {np.median(apart):.3f} (median), "
            f"{max(apart):.3f} (most) from where they say; {remarked} have remarks"
        )
    refused = [row for row, each in enumerate(found) if each.refused]
    if refused:
        first = f"the first is recording {refused[0]}: {found[refused[0]].refused}"
        raise ValueError(f"{len(refused)} of {len(found)} recordings of {options.source} cannot be used; {first}")
    return 0


def read(options: argparse.Namespace) -> list[Demonstration]:
    """Read the recordings of a source of any format.

    Raises:
        ValueError: the source is damaged, or the names of its columns are missing.
        OSError: there is no such source.
    """
    source: Path = options.source
    if not source.exists():
        raise FileNotFoundError(f"there is no {source}")
    if source.suffix == ".npz":
        return load_demonstrations(source)
    if not options.joints or not options.outcome:
        raise ValueError(f"{source} is no .npz file, so name its columns: --joints COLUMN,... --outcome COLUMN,...")
    is_dataset = (source / "meta").is_dir()
    columns = Columns(
        options.joints,
        options.outcome,
        options.context,
        options.time or ("timestamp" if is_dataset else "time"),
        options.recording or ("episode_index" if is_dataset else None),
        options.degrees,
    )
    if not is_dataset:
        return read_csv(source, columns)
    from sgimd_torch.demonstrations.lerobot import read_lerobot  # loads pyarrow, an optional dependency

    return read_lerobot(source, columns)


def check(task: Task, shown: Demonstration, row: int) -> Checked:
    """Translate a recording and execute it on the robot of a task, with motor noise from the stream number ``row``."""
    robot = task.environment
    remarks = beyond_limits(robot, shown)
    try:
        if shown.outcome.shape != (robot.outcomes.dim,):
            raise ValueError(f"its outcome has {shown.outcome.size} numbers, an outcome in T has {robot.outcomes.dim}")
        context = robot.contexts.check("its context", shown.context)
        theta = correspondence_of(task)(shown.times, shown.trajectory)
        theta = robot.policies.check("theta_d of the correspondence", theta)
        lands = execute_many(robot, context[None], theta[None], [stream(row, "demonstrations check")])[0]
    except (ValueError, SimulationError) as error:
        return Checked(shown, None, float("nan"), remarks, str(error))
    return Checked(shown, lands, misfit_of(robot, theta, shown), remarks)


def _cells(row: int, found: Checked) -> tuple[str, ...]:
    """Cells of a recording in the table, one below each of ``HEADS``."""
    times = found.shown.times
    refused = [f"cannot be used: {found.refused}"] if found.refused else []
    return (
        str(row),
        f"{times[-1] - times[0]:.3g}",
        str(len(times)),
        _point(found.shown.outcome),
        *(("-", "-") if found.lands is None else (_point(found.lands), f"{found.apart:.3f}")),
        "-" if np.isnan(found.misfit) else f"{found.misfit:.3f}",
        "; ".join([*refused, *found.remarks]),
    )


def _point(point: Array) -> str:
    return f"({', '.join(f'{x:.3g}' for x in point)})"


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())
