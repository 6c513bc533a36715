"""Demonstrations: are they right for a robot? And how do they get here from other files?

  check    a table with a line for each recording: what it says and where it lands on the simulated robot, how far it is
           from what the robot can play, what lies outside its limits
  import   recordings in CSV or in a LeRobot dataset (v3) become a file for sgimd run --demonstrations

SOURCE is a file that save_demonstrations wrote (.npz); a CSV file or a folder of them, one for each recording; or the
folder of a LeRobot dataset. All but the first need the names of the columns; a column may be a vector, as in LeRobot:
observation.state is all its entries, observation.state[0:6] some. The outcome is read in the last row of a recording,
the context in the first.

Examples:
  sgimd demonstrations check shown.npz --task fishing-rod
  sgimd demonstrations check recordings --task mypackage.toss:make --joints shoulder,elbow --outcome x,y
  sgimd demonstrations import datasets/my_arm --joints observation.state[0:6] --outcome observation.place[0:2]
      --time timestamp --recording episode_index --degrees --out shown.npz

Exit code: 0 each recording can be used, 2 some cannot, or the request is wrong.
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
from sgimd_torch.runs.tasks import Task, correspondence_of
from sgimd_torch.spaces import Array, Demonstration, stream
from sgimd_torch.views.text_table import print_table

HEADS: Final = ("recording", "lasts (s)", "samples", "says", "lands", "apart", "misfit", "remarks")


@dataclass(frozen=True, eq=False)
class Checked:
    """One recording on a robot.

    ``lands`` ``(outcome_dim,)`` is None if it cannot be translated; ``refused`` says why. ``misfit`` is NaN where the
    robot cannot tell. ``remarks`` say what lies outside a limit.
    """

    shown: Demonstration
    lands: Array | None
    misfit: float
    remarks: list[str]
    refused: str = ""

    @property
    def apart(self) -> float:
        """How far it lands from where it says; NaN if it cannot be translated."""
        return float("nan") if self.lands is None else float(np.linalg.norm(self.lands - self.shown.outcome))


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd demonstrations``."""
    source = argparse.ArgumentParser(add_help=False)
    source.add_argument("source", type=Path, metavar="SOURCE")
    for option in ("joints", "outcome", "context"):
        source.add_argument(f"--{option}", type=_names, default=(), metavar="COLUMN,COLUMN")
    source.add_argument("--time", metavar="COLUMN", help="seconds (default: time; of a LeRobot dataset: timestamp)")
    source.add_argument("--recording", metavar="COLUMN", help="its number or name (of LeRobot: episode_index)")
    source.add_argument("--degrees", action="store_true", help="joints are in degrees")
    shown: dict[str, Any] = {"description": __doc__, "formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = argparse.ArgumentParser(prog="sgimd demonstrations", **shown)
    commands = parser.add_subparsers(dest="command", required=True, metavar="check|import")
    checked = commands.add_parser("check", help="are they right for a robot?", parents=[source], **shown)
    checked.add_argument("--task", required=True, metavar="ENVIRONMENT", help="as sgimd run --environment")
    imported = commands.add_parser("import", help="into a file for --demonstrations", parents=[source], **shown)
    imported.add_argument("--out", type=Path, required=True, metavar="FILE.npz")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Check or import; the exit code, 0.

    Raises:
        ValueError: the source cannot be read, or the robot cannot use all of it.
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
        raise ValueError(f"{options.source} says nothing of the context ({what}); name its columns with --context")
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
    """The recordings of the source, whatever kind it is.

    Raises:
        ValueError: see the readers; or columns are not named.
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
    from sgimd_torch.demonstrations.lerobot import read_lerobot  # pyarrow is loaded only when it is needed

    return read_lerobot(source, columns)


def check(task: Task, shown: Demonstration, row: int) -> Checked:
    """One recording, translated and executed on the task's robot with a noise of its own."""
    robot = task.environment
    remarks = beyond_limits(robot, shown)
    try:
        if shown.outcome.shape != (robot.outcomes.dim,):
            raise ValueError(f"its outcome has {shown.outcome.size} numbers, the robot's has {robot.outcomes.dim}")
        context = robot.contexts.check("its context", shown.context)
        theta = correspondence_of(task)(shown.times, shown.trajectory)
        theta = robot.policies.check("theta_d of the correspondence", theta)
        lands = execute_many(robot, context[None], theta[None], [stream(row, "demonstrations check")])[0]
    except (ValueError, SimulationError) as error:
        return Checked(shown, None, float("nan"), remarks, str(error))
    return Checked(shown, lands, misfit_of(robot, theta, shown), remarks)


def _cells(row: int, found: Checked) -> tuple[str, ...]:
    """Of the table, below ``HEADS``."""
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
