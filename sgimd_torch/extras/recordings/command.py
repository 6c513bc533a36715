"""Check recordings on a robot, import them from other formats, or record movements of an arm that you lead.

  check    prints a line for each recording: the recorded outcome (says), the outcome on the simulated robot (lands),
           the distance between these outcomes (apart), the distance from the recording to the movement that the robot
           plays (misfit), and the limits of the robot that the recording exceeds (remarks)
  import   converts recordings to a file for sgimd run --demonstrations; with --environment it checks them first
  record   records movements of an arm that you lead by hand, with torque off; each ends when the arm has been still

SOURCE is an .npz file of save_demonstrations, a text file with columns, a folder with a text file for each recording,
or the folder of a LeRobot dataset (v2.1 or v3). Columns of a text are divided by commas, semicolons, tabs or spaces.
Options name the columns. A column may be a vector, as in LeRobot: observation.state is the whole vector,
observation.state[0:6] is its first six entries, and gripper.pos is the entry of this name.

The outcome is read in the last row of a recording, and the context in its first row. Without --outcome, the robot
replays the recording, or executes its translation if it cannot replay, and this outcome counts.

Examples:
  sgimd demonstrations check shown.npz --environment fishing-rod
  sgimd demonstrations check logs --environment mypackage.toss:make --columns time,a,b,x,y --joints a,b --outcome x,y
  sgimd demonstrations import datasets/my_arm --joints observation.state --environment mypackage.arm:make
      --unit deg,gripper=0:100 --trim --out shown.npz
  sgimd demonstrations record --environment lerobot --environment.robot so101_follower ... --out shown.npz

Exit code: 0 all recordings can be used, 2 some cannot be used, or the request is wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.fit import misfit_of
from sgimd_torch.environments.protocol import (
    Replaying,
    SimulationError,
    beside_execute,
    execute_one,
    primitive_of,
    tried,
)
from sgimd_torch.extras.recordings.columns import ColumnNames, Recording
from sgimd_torch.extras.recordings.limits import beyond_limits, implausible
from sgimd_torch.extras.recordings.text import read_text
from sgimd_torch.extras.recordings.units import in_units, paced, units_from, unwrapped
from sgimd_torch.extras.table.results import print_table
from sgimd_torch.files import check_regular, check_writable
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.plan import task_of
from sgimd_torch.runs.program import argument, parser_of
from sgimd_torch.spaces import Array, Box, Demonstration, Failure, stream
from sgimd_torch.tasks import Task
from sgimd_torch.tasks.taught import theta_of
from sgimd_torch.texts import NUMBER

HEADS: Final = ("recording", "lasts (s)", "samples", "says", "lands", "apart", "misfit", "remarks")


@dataclass(frozen=True, eq=False)
class Checked:
    """A recording, checked on a robot.

    Attributes:
        demonstration: the recording.
        lands: ``(outcome_dim,)`` outcome on the robot, None if the robot cannot use the recording.
        misfit: distance from the recording to the movement that the robot plays, NaN if unknown; see `misfit_of`.
        remarks: sentences, one for each limit of the robot that the recording exceeds.
        fault: reason why the robot cannot use the recording, "" if it can.
    """

    demonstration: Demonstration
    lands: Array | None
    misfit: float
    remarks: list[str]
    fault: str = ""

    @property
    def apart(self) -> float:
        """Distance from the recorded outcome to the outcome on the robot; NaN without an outcome on the robot."""
        return float("nan") if self.lands is None else float(np.linalg.norm(self.lands - self.demonstration.outcome))


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd demonstrations``."""
    source = argparse.ArgumentParser(add_help=False)
    source.add_argument("source", type=Path, metavar="SOURCE")
    columns = {
        "joints": "columns of joint angles or commands, in the robot's order (default: names of the robot's joints)",
        "outcome": "columns of the outcome (default: outcome on the robot of --environment)",
        "context": "columns of the context",
        "columns": "names of all columns of a text whose first row has no names",
    }
    for option, about in columns.items():
        source.add_argument(f"--{option}", type=_names, default=(), metavar="COLUMN,COLUMN", help=about)
    timed = source.add_mutually_exclusive_group()
    timed.add_argument("--time", metavar="COLUMN", help="column of times in s (default: time; in LeRobot timestamp)")
    timed.add_argument("--rate", type=_above_zero, metavar="HZ", help="samples per second, if there are no times")
    source.add_argument(
        "--recording",
        metavar="COLUMN",
        help="column that divides a table into recordings (default: none; in LeRobot episode_index)",
    )
    source.add_argument(
        "--unit",
        type=units_from,
        default={},
        metavar="UNIT,JOINT=UNIT",
        help="unit of all or of single joints: rad, deg, or a range such as 0:100, which maps onto the joint's range; "
        "rad leaves commands alone (default: rad, unless a joint reads more than a turn)",
    )
    source.add_argument("--speed", type=_above_zero, default=1.0, help="factor on the speed (default: %(default)s)")
    joined = "joints logged in (-pi, pi] whose jumps by a turn are taken away"
    source.add_argument("--unwrap", type=_names, default=(), metavar="JOINT,JOINT", help=joined)
    source.add_argument("--strict", action="store_true", help="recordings with remarks cannot be used")
    source.add_argument("--trim", action="store_true", help="cut off stillness before and after the movement")
    described: dict[str, Any] = {"description": __doc__, "formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = parser_of("demonstrations", __doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="check|import|record")
    checked = commands.add_parser("check", help="execute recordings on a robot", parents=[source], **described)
    imported = commands.add_parser(
        "import", help="convert recordings to a file for --demonstrations", parents=[source], **described
    )
    recorded = commands.add_parser("record", help="record movements of an arm that you lead by hand", **described)
    for command in (checked, imported, recorded):
        command.add_argument(
            "--environment",
            required=command is not imported,
            metavar="ENVIRONMENT",
            help="robot that executes the recordings, and its options, as for sgimd run: a name or module:attribute",
        )
    for command in (imported, recorded):
        command.add_argument("--out", type=Path, required=True, metavar="FILE.npz", help="file to write")
    imported.add_argument("--skip-unusable", action="store_true", help="leave out recordings that cannot be used")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Check, import or record demonstrations, and return the exit code 0.

    Raises:
        ValueError: the source cannot be read, or some recordings cannot be used.
        OSError: a file cannot be read or written.
    """
    options, of_robot = parser().parse_known_args(argv)
    importing = options.command == "import"
    if options.command != "check":
        if options.out.suffix != ".npz":
            raise ValueError(f"--out must end in .npz, got {options.out}")
        check_writable(options.out)
    if options.command != "record":
        check_regular(options.source)
    task = None
    if options.environment:
        task = task_of(parse([f"--environment={options.environment}", *of_robot])[0])
    elif of_robot:
        raise ValueError(f"{of_robot[0]} is no option of sgimd demonstrations import, or needs --environment")
    if options.command == "record":
        assert task is not None
        record_led(task, options.out)
        return 0
    recordings = read_recordings(options, primitive_of(task.environment).ranges if task else None)
    recordings = _looked_at(recordings, strict=options.strict)
    if task is not None:
        recordings = _on_robot(task, recordings, options.source, strict=options.strict)
    unusable, usable = ([rec for rec in recordings if bool(rec.fault) is faulty] for faulty in (True, False))
    if unusable:
        first = f"{unusable[0].name}: {unusable[0].fault}"
        told = (
            f"{len(unusable)} of {len(recordings)} recordings of {options.source} cannot be used; the first is {first}"
        )
        if len(recordings) == 1:
            told = f"{options.source} cannot be used: {unusable[0].fault}"
        if not usable or not importing or not options.skip_unusable:
            raise ValueError(told + "; --skip-unusable leaves such out" * bool(importing and usable))
        say(*(f"left out {recording.name}: {recording.fault}" for recording in unusable))
    if importing:
        demonstrations = [recording.demonstration for recording in usable if recording.demonstration is not None]
        save_demonstrations(options.out, demonstrations)
        print(f"{options.out}: {len(demonstrations)} recordings, {demonstrations[0].trajectory.shape[1]} joints")
    return 0


def record_led(task: Task, out: Path) -> None:
    """Write movements of an arm that somebody leads into ``out``, one after the other, until the input ends.

    Raises:
        ValueError: nobody can lead this robot.
        OSError: the file cannot be written.
    """
    robot, shown = task.environment, list[Demonstration]()
    lead: Callable[[], Demonstration] | None = getattr(robot, "lead", None)
    if lead is None:
        raise ValueError(f"nobody can lead {type(robot).__name__} by hand; sgimd teach leads a simulated arm")
    while True:
        try:
            input("Enter: torque goes off, lead the arm; Ctrl-D: done. ")
        except EOFError:
            return
        demonstration = lead()
        try:
            misfit = misfit_of(robot, theta_of(task, demonstration), demonstration)
        except ValueError as error:
            print(f"not kept: {error}")
            continue
        shown.append(demonstration)
        save_demonstrations(out, shown)
        where = _point(demonstration.outcome)
        print(
            f"{out}: movement {len(shown)}, {demonstration.times[-1]:.3g} s, outcome {where}, misfit {misfit:.3f} rad"
        )


def read_recordings(options: argparse.Namespace, ranges: Box | None) -> list[Recording]:
    """Read the recordings of a source of any format; ``ranges`` are those of the robot's joints, if they are known.

    Raises:
        ValueError: the source is damaged, or names or units of its columns are missing.
        OSError: the source cannot be read.
    """
    source, units, unclear = options.source, options.unit, ""
    is_dataset = any((source / folder).is_dir() for folder in ("meta", "meta_data")) or source.suffix == ".parquet"
    if source.suffix == ".npz":
        demonstrations = load_demonstrations(source)
        names = tuple(f"joint {k}" for k in range(demonstrations[0].trajectory.shape[1]))
        recordings = [Recording(str(row), demonstration, names) for row, demonstration in enumerate(demonstrations)]
        units = {"": "rad", **units}
    elif is_dataset:
        from sgimd_torch.extras.recordings.lerobot import read_lerobot  # loads pyarrow, an optional dependency

        recordings, unclear = read_lerobot(source, _columns(options, ranges, "timestamp", "episode_index"))
    else:
        recordings = read_text(source, _columns(options, ranges, "time", None))
    recordings = unwrapped(in_units(recordings, units, ranges, unclear=unclear), options.unwrap)
    return [paced(recording, options.speed, trim=options.trim) for recording in recordings]


def _columns(options: argparse.Namespace, ranges: Box | None, time: str, recording: str | None) -> ColumnNames:
    """The columns that the options name; ``time`` and ``recording`` are defaults."""
    joints = options.joints or (ranges.names if ranges is not None else ())
    if not joints:
        raise ValueError(f"{options.source} is no .npz file, so name its columns of joints: --joints COLUMN,COLUMN")
    if not options.outcome and not options.environment:
        raise ValueError(
            f"{options.source} needs outcomes: name their columns with --outcome COLUMN,COLUMN, or name a robot with "
            "--environment, which then executes the recordings"
        )
    times, divided = options.time or time, options.recording or recording
    return ColumnNames(joints, options.outcome, options.context, times, divided, options.rate, options.columns)


def check(task: Task, demonstration: Demonstration, row: int) -> Checked:
    """Translate a recording and execute it on the robot of a task, with motor noise from the stream number ``row``.

    A recording without an outcome gets the outcome of its replay, or of its translation if the robot has no replay.
    """
    robot = task.environment
    remarks = beyond_limits(robot, demonstration)
    try:
        if demonstration.outcome.size and demonstration.outcome.shape != (robot.outcomes.dim,):
            raise ValueError(
                f"its outcome has {demonstration.outcome.size} numbers, an outcome in T has {robot.outcomes.dim}"
            )
        context = robot.contexts.check("its context", demonstration.context)
        theta = theta_of(task, demonstration)
        lands = execute_one(robot, context, theta, stream(row, "demonstrations check"))
        if not demonstration.outcome.size:
            outcome = lands
            # A replay has no context.
            if isinstance(robot, Replaying) and beside_execute(robot, "replay") and not context.size:
                replayed = tried("outcome", len(lands), robot.replay, demonstration.times, demonstration.trajectory)
                if isinstance(replayed, Failure):
                    raise SimulationError(f"its replay failed: {replayed.reason}")
                outcome = replayed
            demonstration = replace(demonstration, outcome=outcome)
            remarks = beyond_limits(robot, demonstration)
    except (ValueError, SimulationError) as error:
        return Checked(demonstration, None, float("nan"), remarks, str(error))
    misfit, trajectory = misfit_of(robot, theta, demonstration), demonstration.trajectory
    if misfit > np.sqrt(np.mean((trajectory - trajectory.mean(axis=0)) ** 2)):
        remarks = [*remarks, "its misfit is no better than that of standing still: are joints and units right?"]
    return Checked(demonstration, lands, misfit, remarks)


def _looked_at(recordings: Sequence[Recording], *, strict: bool) -> list[Recording]:
    """The recordings; says which readings are not plausible, each kind once. If ``strict``, these cannot be used."""
    named, after = dict[str, list[str]](), list[Recording]()
    for recording in recordings:
        shown = recording.demonstration
        remarks = [] if shown is None else implausible(shown, recording.joints)
        for remark in remarks:
            named.setdefault(remark, []).append(recording.name)
        fault = recording.fault or "; ".join(remarks) * strict
        after.append(recording._replace(fault=fault, demonstration=None if fault else shown))
    say(*(f"{remark} ({len(names)} of {len(recordings)}, first {names[0]})" for remark, names in named.items()))
    return after


def _on_robot(task: Task, recordings: Sequence[Recording], source: Path, *, strict: bool) -> list[Recording]:
    """The recordings after a check on the robot of the task; prints a line for each of them."""
    contexts = task.environment.contexts
    if contexts.dim and any(rec.demonstration and not rec.demonstration.context.size for rec in recordings):
        what = ", ".join(contexts.axis(k, "context") for k in range(contexts.dim))
        raise ValueError(f"{source} has no context ({what}); name its columns with --context")
    table: list[Sequence[str]] = [HEADS]
    after, apart, remarked = list[Recording](), list[float](), 0
    for row, recording in enumerate(recordings):
        if recording.demonstration is None:
            table.append((recording.name, *"------", f"cannot be used: {recording.fault}"))
            after.append(recording)
            continue
        checked = check(task, recording.demonstration, row)
        table.append(_cells(recording.name, checked))
        fault = checked.fault or "; ".join(checked.remarks) * strict
        after.append(recording._replace(demonstration=checked.demonstration, fault=fault))
        remarked += bool(checked.remarks)
        apart += [] if checked.lands is None else [checked.apart]
    print_table(table)
    if apart:
        print(
            f"{len(apart)} of {len(recordings)} can be used; they land {np.median(apart):.3f} (median), "
            f"{max(apart):.3f} (most) from where they say; {remarked} have remarks"
        )
    return after


def _cells(name: str, checked: Checked) -> tuple[str, ...]:
    """Cells of a recording in the table, one below each of ``HEADS``."""
    times = checked.demonstration.times
    faults = [f"cannot be used: {checked.fault}"] if checked.fault else []
    return (
        name,
        f"{times[-1] - times[0]:.3g}",
        str(len(times)),
        _point(checked.demonstration.outcome),
        *(("-", "-") if checked.lands is None else (_point(checked.lands), f"{checked.apart:.3f}")),
        "-" if np.isnan(checked.misfit) else f"{checked.misfit:.3f}",
        "; ".join([*faults, *checked.remarks]),
    )


def _point(point: Array) -> str:
    return f"({', '.join(f'{x:.3g}' for x in point)})"


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _above_zero(text: str) -> float:
    value = argument(NUMBER, text)
    if not 0 < value < np.inf:
        raise argparse.ArgumentTypeError(f"must be above 0, got {text}")
    return value
