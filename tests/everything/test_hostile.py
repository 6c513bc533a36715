"""Parts of a user's own that do whatever they like: a run goes on, or ends in one clear message; nothing is lost."""

import re

import numpy as np
import pytest

from sgimd_torch.record import RunError
from sgimd_torch.runs import command as run_command
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run

MODULE = '''
import numpy as np
from sgimd_torch.extras.asking.teachers import AnsweringTeacher
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.spaces import Box, Demonstration
from sgimd_torch.teachers import PeriodicTeacher
from sgimd_torch.tasks import Task
from sgimd_torch.tasks.robots import arm_demonstrations

class Mute(Exception):
    def __str__(self):
        raise RuntimeError("even the message fails")

def throw(error):
    raise error

def scribble(part, found):
    for each in (found, *vars(part).values()):
        if isinstance(each, np.ndarray) and each.flags.writeable:
            each[...] = np.nan
    return found

HABITS = {
    "raises": lambda part, found: throw(ValueError("it is\\nbroken \\x1b[31m")),
    "exits": lambda part, found: throw(SystemExit(0)),
    "stops": lambda part, found: throw(StopIteration()),
    "runs_out": lambda part, found: throw(MemoryError()),
    "is_mute": lambda part, found: throw(Mute()),
    "none": lambda part, found: None,
    "text": lambda part, found: "far",
    "nan": lambda part, found: found * np.nan if isinstance(found, np.ndarray) else np.nan,
    "huge": lambda part, found: np.full(2, 1e300),
    "shape": lambda part, found: np.zeros((3, 3)),
    "objects": lambda part, found: np.array([None, {}]),
    "scribbles": scribble,
    "boxes": lambda part, found: (setattr(getattr(part, "problem", part), "outcomes", Box.cube(0, 1, 5)), found)[1],
}

def spoilt(kind, member, habit):
    """``kind``, of which every third call of a member has this habit."""
    def spoil(self, *given):
        calls = vars(self).get("calls", 0) + 1
        vars(self)["calls"] = calls
        found = getattr(kind, member)(self, *given)
        return HABITS[habit](self, found) if calls % 3 == 0 else found
    return type(kind.__name__, (kind,), {member: spoil})

class Arm(PlanarArm):
    def __init__(self):
        super().__init__(3, noise=0.01)

def make(kind=Arm):
    arm = kind()
    goals = Benchmark(type(arm).__name__, np.array([[0.5, 0.5], [-0.3, 0.2]]), 0.1)
    return Task(arm, lambda: goals, lambda: arm_demonstrations(Arm()), arm.correspondence)

for habit in HABITS:
    for member in ("observe", "execute"):
        globals()[f"{member}_{habit}"] = lambda habit=habit, member=member: make(spoilt(Arm, member, habit))
    globals()[f"offer_{habit}"] = spoilt(PeriodicTeacher, "offer", habit)
    globals()[f"sample_{habit}"] = spoilt(UniformGoals, "sample", habit)
    globals()[f"call_{habit}"] = spoilt(NearestNeighbour, "__call__", habit)
    globals()[f"demonstrate_{habit}"] = spoilt(AnsweringTeacher, "demonstrate", habit)
'''
HABITS = tuple(re.findall(r'^    "(\w+)": ', MODULE, re.MULTILINE))
ARM = "--environment hostile:make"
PARTS = {
    "observe": "--environment hostile:{} --algorithm sagg-riac",
    "execute": "--environment hostile:{} --algorithm sagg-riac",
    "offer": f"{ARM} --algorithm sgim-d --teacher hostile:{{}}",
    "sample": f"{ARM} --algorithm sagg-riac --goals hostile:{{}}",
    "call": f"{ARM} --algorithm sagg-riac --inverse hostile:{{}}",
    "demonstrate": f"{ARM} --algorithm sgim-im --teachers hostile:{{}}",
}


@pytest.mark.filterwarnings("ignore:teacher hostile")
@pytest.mark.parametrize("habit", HABITS)
@pytest.mark.parametrize("member", PARTS)
def test_whatever_a_part_does_a_run_goes_on_or_ends_in_one_clear_message(module, capsys, member, habit):
    module("hostile", MODULE)
    words = f"{PARTS[member].format(f'{member}_{habit}')} --movements 40 --repeats 0 --name one".split()
    code = command(run_command.main, words)
    said = capsys.readouterr().err
    assert "\x1b" not in said
    try:
        run = read_run("runs/one/seed-000")
    except RunError:
        assert code == 2  # refused before its first movement
        return
    lived = np.isfinite(run.outcomes).all(axis=1)
    assert np.isfinite(run.thetas[lived]).all()
    if code == 0:
        assert run.summary["finished"]
        return
    assert code == 1
    last = said.rstrip().rpartition("\n")[2]
    assert re.fullmatch(rf"error: .*; {len(run.index)} movements are kept; to go on: .* run .*--resume", last), said
