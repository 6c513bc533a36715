"""Ask a run for movements: theta for each goal, and the outcome that the run expects.

expected_distance is the distance from the goal to this outcome; expected_deviation is the mean distance, noise
included, at which outcomes of theta scatter around it. The learner repeats its record, then its inverse model answers.
With --execute, the robot of the run executes each answer: reached is the outcome, error its distance from the goal.
With --out, the answers are a table for other programs; with --trajectory, the joints over time.

Exit code: 0 done, 1 a movement failed, 2 the request is wrong.

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
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.environments.protocol import execute_many, primitive_of
from sgimd_torch.evaluation import beyond
from sgimd_torch.files import check_writable, read_csv, write_text
from sgimd_torch.memory.compiled import compile_all
from sgimd_torch.runs.load import OpenRun
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import Failed, parser_of
from sgimd_torch.runs.run_parts import RunParts
from sgimd_torch.runs.signals import Stopped, Stopping
from sgimd_torch.spaces import Array, Box, Failure, stream
from sgimd_torch.texts import NUMBER

Answer = dict[str, Array]
"""Vectors of an answer, by the names "goal", "context", "theta", "expected" and "reached", and ``DISTANCES``, of one
entry each; NaN after a failed movement."""
DISTANCES: Final = ("expected_distance", "expected_deviation", "error")  # in the unit of T


def main(argv: Sequence[str] | None = None) -> int:
    """Print or write the answers and return the exit code 0.

    Raises:
        Failed: a movement failed; all answers are printed or written before.
        ValueError: the request is wrong, or a goal or the context lies outside its space.
        OSError: a file cannot be read or written.
    """
    options = parser().parse_args(argv)
    for path in filter(None, (options.out, options.trajectory)):
        check_writable(path)
    with Stopping("stopping before the next movement; Ctrl-C once more stops at once") as stopping:
        if options.execute:  # before there is a robot; numba may lose the exception of a signal
            compile_all()
            _stop_if(stopping)
        run = OpenRun(options.run, trust=options.trust)
        parts = run.parts
        goals = [*options.goal, *(_read(options.goals, parts.environment.outcomes) if options.goals else [])]
        if not goals or (options.trajectory and len(goals) > 1):
            raise ValueError("give --goal X,Y or --goals FILE; --trajectory takes one goal")
        run.recall()
        answers = list(_answers(parts, goals, options.context))
        asked = np.stack([answer["goal"] for answer in answers])
        for goal in asked[beyond(parts.learner.memory.outcomes, asked)]:
            say(f"goal {_text(goal)} looks out of reach: all outcomes near it lie on one side of it")
        failed = list(_execute(parts, answers, stopping)) if options.execute else []
    if options.trajectory:
        _write_trajectory(options.trajectory, parts, answers[0]["theta"])
    if options.out is None:
        print("\n".join(_line(answer, parts.environment.outcomes) for answer in answers))
    else:
        sizes = {name: len(value) for name, value in answers[0].items()}
        heads = [name if name in DISTANCES else f"{name}_{k}" for name, n in sizes.items() for k in range(n)]
        _write(options.out, heads, (np.concatenate([*answer.values()]) for answer in answers))
        print(f"{len(answers)} answers: {options.out}")
    if failed:
        raise Failed(f"{len(failed)} of {len(answers)} movements failed, the first for {failed[0]}")
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


def _answers(parts: RunParts, goals: Sequence[Sequence[float]], given: Sequence[float] | None) -> Iterator[Answer]:
    robot, inverse = parts.environment, parts.learner.inverse
    if given is None and (why := getattr(robot, "asks_context", "")):
        raise ValueError(f"--context must be given: {why}; it is {', '.join(robot.contexts.names)}")
    middle = (robot.contexts.low + robot.contexts.high) / 2
    context = robot.contexts.check("--context", middle if given is None else given)
    if not len(parts.learner.memory):
        raise ValueError(f"{parts.config.directory} has an empty memory, so it infers no movement")
    for point in goals:
        goal = robot.outcomes.check("goal", point, "it is a point of T, such as 0.3,0.2")
        estimate = inverse(context, goal)
        theta, expected = estimate.theta, estimate.expected
        answer = {"goal": goal, "context": context, "theta": theta}
        if expected is None:
            expected = inverse.predict(context, theta)
        if expected is not None:
            answer["expected"] = expected
            answer["expected_distance"] = np.array([math.dist(expected, goal)])
        if estimate.sd is not None:
            answer["expected_deviation"] = np.array([estimate.expected_deviation])
        yield answer


def _stop_if(stopping: Stopping) -> None:
    if stopping.heard:
        raise Stopped(stopping.heard)


def _execute(parts: RunParts, answers: Sequence[Answer], stopping: Stopping) -> Iterator[str]:
    """Add to each answer what the robot reaches with it; yields a reason for each movement that fails."""
    robot = parts.environment
    for k, answer in enumerate(answers):
        _stop_if(stopping)
        rng = stream(parts.config.seed, "ask", k)
        (reached,) = execute_many(robot, [answer["context"]], [answer["theta"]], [rng])
        if isinstance(reached, Failure):
            yield f"goal {_text(answer['goal'])}: {reached.reason}"
            reached = np.full(robot.outcomes.dim, np.nan)
        answer |= {"reached": reached, "error": np.array([robot.outcomes.distance(reached, answer["goal"])])}


def _read(path: Path, box: Box) -> list[list[float]]:
    """The goals in a file; a first line of names is a header."""
    goals = list[list[float]]()
    for number, row in read_csv(path):
        try:
            goals.append([NUMBER.of(cell) for cell in row])
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
    table.writerows(["" if np.isnan(x) else float(x) for x in row] for row in rows)
    write_text(path, text.getvalue())


def _line(answer: Answer, box: Box) -> str:
    """An answer as text, without what is not known."""
    known = {name: value for name, value in answer.items() if len(value) and np.isfinite(value).all()}
    return "; ".join(
        f"{name} {box.amount(value.item(), '.4g') if name in DISTANCES else _text(value)}"
        for name, value in known.items()
    )


def _text(value: Array) -> str:
    return ",".join(f"{x:.4g}" for x in value)
