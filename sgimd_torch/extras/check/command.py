"""Check an environment against every rule of the environment protocol. Violations are named, with the likely cause.

ENVIRONMENT is a name of the catalogue, or package.module:attribute. The attribute is a class or a function that returns
an environment or a Task; the module may be in the working directory. The check executes random movements and two
corners of Pi:

  contexts, policies, outcomes    are Boxes, and rest lies in outcomes
  observe, execute                return float64 arrays of the right shape, draw from their rng alone, and change
                                  neither arguments nor earlier results
  no state carries over           a movement repeated with an equal stream has the same outcome; a difference by
                                  rounding is a remark
  outcome_noise                   is 0 if repeated outcomes are equal, else right for the median movement within a
                                  factor of ten; a movement that scatters far more is a remark
  execute_many (optional)         each row equals execute to the last bit
  invalid movements               are refused with a ValueError
  trace (optional)                has the same outcome as execute with an equal stream
  a Task                          its goals lie in T, and its demonstrations can be translated

Examples:
  sgimd check mypackage.toss:make
  sgimd check fishing-rod --movements 20
  sgimd check mujoco --environment.model arm.xml --environment.outcome site:tip      options, as of sgimd run

Exit code: 0 the environment keeps every rule, 2 it does not.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from sgimd_torch.environments.protocol import Environment, FromFiles, beside_execute, execute_many
from sgimd_torch.extras.check.promises import check_environment
from sgimd_torch.extras.check.remarks import remarks_on
from sgimd_torch.extras.film.traced import traced
from sgimd_torch.extras.recordings.command import check
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.plan import task_of
from sgimd_torch.runs.program import parser_of
from sgimd_torch.spaces import Failure, check_count, stream
from sgimd_torch.tasks import Task, benchmark_of
from sgimd_torch.tasks.taught import demonstrations_of

TRIED = 20  # number of random movements whose outcomes are looked at


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd check``."""
    parser = parser_of("check", __doc__)
    parser.add_argument("environment", metavar="ENVIRONMENT", help="name such as fishing-rod, or mypackage.toss:make")
    parser.add_argument("--movements", type=int, default=3, metavar="N", help="random movements (default: %(default)s)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print the findings and return the exit code 0.

    Raises:
        ValueError: there is no such environment, or it violates a rule.
    """
    options, of_environment = parser().parse_known_args(argv)
    check_count("--movements", options.movements, 1)
    config, _ = parse([f"--environment={options.environment}", *of_environment])
    try:
        task = task_of(config)
    except (ValueError, OSError):
        raise
    except (Exception, SystemExit) as error:  # the user's code may raise anything
        why = f"{type(error).__name__}: {error}"
        raise ValueError(f"environment {options.environment} cannot be made: {why}") from error
    name = type(task.environment).__name__
    try:
        remarks = check_environment(task.environment, movements=options.movements)
        _check_picture(task)
        lines = [f"{name} keeps every promise", *(f"  {remark}" for remark in remarks), *_goals(task), *_lessons(task)]
    except SystemExit as end:  # exit(0) in the user's code would look like success
        raise ValueError(f"{name} calls exit({end}); raise an exception where a movement fails") from end
    print("\n".join(lines))
    return 0


def _check_picture(task: Task) -> None:
    """Compare the outcomes of ``execute`` and ``trace`` for one movement.

    Raises:
        ValueError: the outcomes differ, or the movement cannot be traced; see `traced`.
    """
    robot = task.environment
    if not beside_execute(robot, "trace"):
        return
    context, theta = robot.observe(stream(0, "check")), robot.policies.sample(stream(1, "check"))
    outcome = robot.execute(context.copy(), theta.copy(), stream(2, "check"))
    name = type(robot).__name__
    drawn = traced(robot, context, theta, stream(2, "check")).outcome
    if not np.array_equal(drawn, outcome):
        raise ValueError(
            f"trace() of {name} ends at {drawn.tolist()}, execute() with an equal stream at "
            f"{outcome.tolist()}; do both methods draw their noise in the same order?"
        )


def _goals(task: Task) -> list[str]:
    robot, (goals, notes, _) = task.environment, benchmark_of(task, None)
    remarks = robot.remarks if isinstance(robot, FromFiles) else ()
    notes = [f"goals of evaluation: {len(goals.goals)}", *remarks, *notes, *_remarks(robot)]
    return [f"  {line}" for line in notes]


def _remarks(robot: Environment) -> list[str]:
    """What random movements tell of the robot, see `remarks_on`."""
    rngs = [stream(k, "check") for k in range(TRIED)]
    contexts, thetas = [robot.observe(rng) for rng in rngs], [robot.policies.sample(rng) for rng in rngs]
    executed = execute_many(robot, contexts, thetas, rngs)
    lost = [outcome.reason for outcome in executed if isinstance(outcome, Failure)]
    failed = [f"{len(lost)} of {TRIED} random movements failed, such as: {lost[0]}"] if lost else []
    outcomes = [outcome for outcome in executed if not isinstance(outcome, Failure)]
    return [*failed, *remarks_on(robot, np.reshape(outcomes, (len(outcomes), robot.outcomes.dim))).values()]


def _lessons(task: Task) -> list[str]:
    if task.demonstrations is None:
        return ["  demonstrations: none"]
    demonstrations, notes, _ = demonstrations_of(task, None)
    outcomes = np.array([demonstration.outcome for demonstration in demonstrations])
    tried = [check(task, demonstration, row) for row, demonstration in enumerate(demonstrations[:TRIED])]
    apart, spread = np.median([checked.apart for checked in tried]), np.linalg.norm(outcomes.std(axis=0))
    if not apart <= max(spread / 2, 3 * task.environment.outcome_noise):
        amount = task.environment.outcomes.amount(float(apart))
        notes = [
            *notes,
            f"when executed, they land {amount} from recorded outcomes (median); are joints, units and times right?",
        ]
    return [f"  demonstrations: {len(demonstrations)}", *(f"  {note}" for note in notes)]
