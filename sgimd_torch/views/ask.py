"""Ask a run for movements: theta for each goal, the outcome that the run expects, and how far it may be off.

That is the mean distance from the expected outcome, noise included, in the unit of T.
The learner repeats its record, then its inverse model answers. With --execute, the robot of the run executes each
answer. With --out, the answers are a table for other programs; with --trajectory, the joints over time.

Examples:
  sgimd ask runs/practice/seed-000 --goal 0.3,0.2
  sgimd ask runs/practice/seed-000 --goal 0.3,0.2 --context 0.1 --execute
  sgimd ask runs/practice/seed-000 --goals goals.csv --out answers.csv
  sgimd ask runs/practice/seed-000 --goal 0.3,0.2 --trajectory joints.csv
"""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.environments.protocol import primitive_of
from sgimd_torch.files import check_writable, write_text
from sgimd_torch.options.build import RunParts
from sgimd_torch.options.signature import parsed
from sgimd_torch.runs.load import OpenRun
from sgimd_torch.runs.past import read_csv
from sgimd_torch.runs.signals import parser_of
from sgimd_torch.spaces import Array, Box, stream

Answer = dict[str, Array]
"""Vectors of an answer, by the names "goal", "context", "theta", "expected", "expected_deviation" and "reached"."""


def main(argv: Sequence[str] | None = None) -> int:
    """Print or write the answers and return the exit code 0.

    Raises:
        ValueError: the request is wrong, or a goal or the context lies outside its space.
        OSError: a file cannot be read or written.
    """
    options = parser().parse_args(argv)
    run = OpenRun(options.run, trust=options.trust)
    for path in filter(None, (options.out, options.trajectory)):
        check_writable(path)
    parts = run.parts
    goals = [*options.goal, *(_read(options.goals, parts.environment.outcomes) if options.goals else [])]
    if not goals or (options.trajectory and len(goals) > 1):
        raise ValueError("give --goal X,Y or --goals FILE; --trajectory takes one goal")
    run.replay()
    answers = list(_answers(parts, goals, options.context, execute=options.execute))
    if options.trajectory:
        _write_trajectory(options.trajectory, parts, answers[0]["theta"])
    if options.out is None:
        for answer in answers:
            print("; ".join(f"{name} {_text(value)}" for name, value in answer.items() if len(value)))
        return 0
    heads = [
        name if name == "expected_deviation" else f"{name}_{k}"
        for name, value in answers[0].items()
        for k in range(len(value))
    ]
    _write(options.out, heads, (np.concatenate([*answer.values()]) for answer in answers))
    print(f"{len(answers)} answers: {options.out}")
    return 0


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd ask``."""
    parser = parser_of("ask", __doc__)
    parser.add_argument("run", type=Path, help="directory of a run: OUT/NAME/seed-003")
    parser.add_argument("--goal", type="numbers", action="append", default=[], metavar="X,Y", help="point of T")
    parser.add_argument("--goals", type=Path, metavar="FILE", help="table of goals, with commas, one goal a line")
    middle = "context of all goals (default: the middle of C); with --context previous of the run, the last theta"
    parser.add_argument("--context", type="numbers", metavar="X,Y", help=middle)
    parser.add_argument("--execute", action="store_true", help="execute each answer on the robot of the run")
    parser.add_argument("--out", type=Path, metavar="FILE", help="csv file to write, with a line for each goal")
    joints = "csv file to write: time (s) and joints (rad) or commands, 50 times a second"
    parser.add_argument("--trajectory", type=Path, metavar="FILE", help=joints)
    parser.add_argument("--trust", action="store_true", help="execute the user's code that the settings of RUN name")
    return parser


def _answers(
    parts: RunParts, goals: Sequence[Sequence[float]], given: Sequence[float] | None, *, execute: bool
) -> Iterator[Answer]:
    robot, inverse = parts.environment, parts.learner.inverse
    if given is None and parts.config.context:
        names = ", ".join(robot.contexts.names)
        raise ValueError(f"--context must be given, as the run has --context previous; it is: {names}")
    middle = (robot.contexts.low + robot.contexts.high) / 2
    context = robot.contexts.check("--context", middle if given is None else given)
    if not len(parts.learner.memory):
        raise ValueError(f"{parts.config.directory} has an empty memory, so it infers no movement")
    for k, point in enumerate(goals):
        goal = robot.outcomes.check("goal", point, "it is a point of T, such as 0.3,0.2")
        estimate = inverse(context, goal)
        theta, expected = estimate.theta, estimate.expected
        answer = {"goal": goal, "context": context, "theta": theta}
        if expected is None:
            expected = inverse.predict(context, theta)
        if expected is not None:
            answer["expected"] = expected
        if estimate.sd is not None:
            answer["expected_deviation"] = np.array([estimate.expected_deviation])
        if execute:
            answer["reached"] = robot.execute(context, theta, stream(parts.config.seed, "ask", k))
        yield answer


def _read(path: Path, box: Box) -> list[list[float]]:
    """The goals in a file; a first line of names is a header."""
    goals = list[list[float]]()
    for number, row in read_csv(path):
        try:
            goals.append([parsed(cell, float) for cell in row])
        except ValueError as error:
            if number > 1 or not all(cell.strip()[:1].isalpha() for cell in row):
                what = ",".join(row)[:60]
                raise ValueError(f"{path}: line {number} is no goal of {box.dim} numbers: {what}") from error
    return goals


def _write_trajectory(path: Path, parts: RunParts, theta: Array) -> None:
    primitive = primitive_of(parts.environment)
    if not isinstance(primitive, GaussianPrimitive):
        raise ValueError(f"{type(parts.environment).__name__} has no motor primitive that gives joints over time")
    times, joints = primitive.trajectory(theta)
    names = primitive.joints.names or [f"joint_{k}" for k in range(primitive.joints.dim)]
    _write(path, ["time", *names], np.column_stack([times, joints]))


def _write(path: Path, heads: Sequence[str], rows: Iterator[Array] | Array) -> None:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(heads)
    table.writerows([float(x) for x in row] for row in rows)
    write_text(path, text.getvalue())


def _text(value: Array) -> str:
    return ",".join(f"{x:.4g}" for x in value)
