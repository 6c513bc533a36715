"""Wrong commands and wrong calls: each is refused in one line that says what came, what was wanted, the likely slip."""

import re
import sys

import numpy as np
import pytest

import sgimd_torch as s
from sgimd_torch.__main__ import _call
from sgimd_torch.algorithms.paper import sgim_d
from sgimd_torch.environments.protocol import execute_many
from sgimd_torch.evaluation import evaluate
from sgimd_torch.runs.signals import command
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Box, Demonstration, stream
from sgimd_torch.teachers import PeriodicTeacher

ROBOT = """
import numpy as np
from sgimd_torch import Box
from sgimd_torch.environments.protocol import check_movement

class Toss:
    contexts, policies = Box.cube(0, 1, 0), Box.cube(-1, 1, 3)
    outcomes = Box.cube(-2, 2, 2, names=("x", "apex"), unit="m")
    rest, outcome_noise = np.zeros(2), 0.0

    def observe(self, rng):
        return np.zeros(0)

    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return theta[:2] + theta[2]

class Half:
    outcomes, policies = Box.cube(0, 1, 1), Box.cube(0, 1, 1)

def shown():
    return []

number = 7
"""
CSV = "time,q0,q1,x,y\n0,0,0,1,0\n0.1,0.1,0.1,0.9,0.1\n"
COLUMNS = "--joints q0,q1 --outcome x,y"
COMMANDS = {
    "runn": "unknown command 'runn'; did you mean run?",
    "run --algorithm sgimd": r"unknown algorithm 'sgimd'; did you mean sgim-d\? Known are",
    "run sgim-d": "'sgim-d' belongs to no option",
    "run --resume yes": "'yes' belongs to no option; .* takes one value, a flag such as --resume none",
    "run --movements 1e3": "--movements must be a whole number, got '1e3'",
    "run --movements": "--movements needs a value",
    "run --seed 1_0": "--seed must be a whole number, got '1_0'",  # int() of Python would read 10
    "run --algorithm sagg-riac --global-range 0_1,0.9": "--global-range must be two numbers .* got '0_1,0.9'",
    "run --seed -3": "seed must be at least 0, got -3",
    "run --failures 0": "failures must be at least 1, got 0",
    "run --goals uniform --goals.windw 3": "--goals.windw: goals uniform has no such option",
    "run --goals interest-map --goals.windw 3": "goals interest-map has no such option; did you mean goals.window",
    "run --goals.window 12": "--goals.window: goals within-reach has no such option",
    "run --goal uniform": "--goal: algorithm practice has no such option; did you mean goals",
    "run --inverse gaussian": "unknown inverse 'gaussian'; known are linear",
    "run --algorithm sgim-d --teacher periodical": "unknown teacher 'periodical'; did you mean periodic?",
    "run --environment toss.Toss": "unknown environment 'toss.Toss'; .*; is it toss:Toss?",
    "run --environment toss.py:Toss": "without .py and with dots, toss:Toss",
    "run --environment toss:Tos": "toss has no Tos; did you mean Toss?",
    "run --environment tos:make": "environment tos:make: the module tos cannot be imported: ModuleNotFoundError: No ",
    "run --environment broken:make": "No module named 'nothing_of_that_name'; is it installed, or in ",
    "run --environment toss:number": "toss:number must be a class or a function, got a int",
    "run --environment toss:Half": "Half has no contexts, rest, .* execute; an environment has contexts, policies, ",
    "run --goals toss:Toss": "Goals Toss cannot be called with the arguments of its kind: too many",
    "run --algorithm toss:shown": "algorithm toss:shown cannot be called with the arguments of its kind: too many",
    "run --search nelder": r"unknown search 'nelder'; did you mean nelder-mead\? Known are nelder-mead, .*package",
    "run --environment toss:Toss --algorithm sgim-d": "Toss has no demonstrations, .* --algorithm practice",
    "run --algorithm random --environment toss:Toss --environment.noise 1": "environment toss:Toss has no such option",
    "run --algorithm sgim-d --demonstrations nothing.npz": "nothing.npz cannot be read or written",
    "run --algorithm sgim-d --demonstrations shown.csv": "shown.csv is no demonstration file: .* demonstrations import",
    "run --benchmark shown.csv": "shown.csv is no benchmark: it is not an npz file",
    "run --out shown.csv --environment planar-arm-7": "shown.csv.* cannot be made: .* a file in its place",
    "sweep --vary goals=interest-map,unifrm": "unknown goals 'unifrm'; did you mean uniform?",
    "table nowhere": "nowhere does not exist; runs are in OUT/NAME/seed-000",
    "report shown.csv": "shown.csv is a file, not a folder",
    "film nowhere": "nowhere holds no run; runs are in OUT/NAME/seed-000",
    "benchmark nowhere --out goals.txt": "--out must be a .npz file in a folder that exists, got goals.txt",
    "check toss:make": "toss has no make",
    "demonstrations check shown.csv --environment planar-arm-7": "shown.csv is no .npz file, so name its columns",
    f"demonstrations check shown.csv --environment fishing-rod {COLUMNS}": "robot has 6 joints, .* have 2: q0, q1",
    "demonstrations check shown.csv --environment experiments.toys:toss --joints q0,q1,q0,q1 --outcome x,y": (
        r"context \(wind \(m/s²\)\); name .* --context"
    ),
    f"demonstrations check nul.csv --environment planar-arm-7 {COLUMNS}": "nul.csv cannot be used: it has a NUL",
    f"demonstrations import shown.csv {COLUMNS} --out shown.txt": "--out must end in .npz, got shown.txt",
    "run --algorithm random --budget 5": "--budget: algorithm random has no such option",
    "run --algorithm random --teacher.every 5": "--teacher.every: algorithm random learns alone; taught are .* sgim-d",
    "run --demonstrations shown.npz": "--demonstrations: algorithm practice learns alone; taught are .* sgim-d",
    "run --teachers all --algorithm sgim-d": "--teachers: algorithm sgim-d has no such option; did you mean teacher?",
    "run --model.members 5": "--model.members: algorithm practice has no such option",
    "run --inverse.members 5": "--inverse.members: inverse among-effects has no such option",
    "run --algorithm map-elites --epsilon 0.1": "--epsilon: algorithm map-elites has no such option",
    "run --teachers al --algorithm sgim-im": "unknown teachers 'al'; did you mean all",
    "run --evaluated-by own,nearst": "unknown inverse 'nearst'; did you mean nearest",
    "run --evaluated-by nearest": "evaluated_by must begin with own",
    "run --seed x": "--seed must be a whole number, got 'x'",
    "run --movements 0": "movements must be at least 1",
    "run --repeats 1": "repeats must be 0 or at least 2",
    "run --evaluate-at 5,x": "--evaluate-at must be whole numbers with commas or null, got '5,x'",
    "run --evaluate-at 0": "evaluate_at must be at least 1, got 0",
    "run --budget 1.5": "--budget must be a whole number, got '1.5'",
    "run --global-range 1": "--global-range must be two numbers with a comma between, got '1'",
    "run --board perhaps": "--board must be true or false, got 'perhaps'",
    "run --resume=3": "--resume takes no value",
    "run --name ..": "name must be the name of one directory",
    "run --search.sd -1": "sd must be positive",
    "run --algorithm sgim-d --goals.window 7": "window must be even",
    "run --environment.task_space 0": "task_space must be above 0",
    "run --environment.noise nan": "noise must be finite",
    "run --give-up 1": "give_up must be",
    "run --algorithm practice-taught --social.epsilon -1": "epsilon must be",
    "run --algorithm sgim-d --teacher.every 0": "every must be",
    "sweep --vary gaols=uniform": "--gaols",
    "sweep --vary goals=unifrom,alp-gmm": "goals",
    "sweep --vary budget=5,x": "budget",
    "sweep --vary goals": "--vary",
    "sweep --vary goals=": "--vary",
    "sweep --vary =uniform": "--vary",
    "sweep --vary goals=alp-gmm,,uniform": "--vary",
    "sweep --vary seed=0,1": "--seed .*--seeds",
    "sweep --vary name=a,b": "--name",
    "sweep --vary out=a,b": "--out",
    "sweep --seed 3": "--seed .*--seeds",
    "sweep --name=mine": "--name",
    "sweep --vary goals=alp-gmm --vary goals=uniform": "--goals is given twice",
    "sweep --vary budget=1,2 --budget 3": "--budget is given twice",
    "sweep --gaols uniform": "--gaols",
    "sweep stray": "'stray'",
    "demo --seed -1": "seed must be",
    "demo --movements 0": "movements must be",
    "demo --evaluate_at []": "--evaluate-at",
    "demonstrations check nothing.npz --environment planar-arm-7": "nothing.npz cannot be read or written",
    "demo --algorithm random": "--algorithm cannot be given here",
}
MANY_RUNS = {  # what these say is longer: their usage, or the list of runs, comes first
    "sweep --shard 0/4": "--shard.*'0/4'",
    "sweep --shard 5/4": "--shard.*'5/4'",
    "sweep --shard 2": "--shard",
    "sweep --shard 1/x": "--shard",
    "sweep --seeds 5-3": "--seeds.*'5-3'",
    "sweep --seeds=-1": "--seeds",
    "sweep --seeds 1,,2": "--seeds",
    "sweep --seeds five": "--seeds",
    "sweep --seeds 1_0": "must be like 5, 0-19 or 0,3,7-9, got '1_0'",
    "table runs --at 1_0": "argument --at: must be a whole number, got '1_0'",
    "ask run --goal 0.1,1_0": "argument --goal: must be numbers with commas, got '0.1,1_0'",
    "demonstrations import shown.csv --out a.npz --rate 5_0": "argument --rate: must be a number, got '5_0'",
    "sweep --processes 0": "--processes",
    "sweep --processes two": "--processes",
    "sweep --algorithm sgim-d --demonstrations nowhere.npz": "nowhere.npz",
    "sweep --out shown.csv": "shown.csv cannot be made",
}


@pytest.mark.parametrize("words", [*COMMANDS, *MANY_RUNS])
def test_a_wrong_command_is_refused_in_a_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("toss", None)
    files = {"toss.py": ROBOT, "shown.csv": CSV, "nul.csv": CSV.replace("0.9", "0.9\0")}
    files["broken.py"] = "import nothing_of_that_name\n"
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    assert command(_call, words.split()) == 2
    said = capsys.readouterr().err.removesuffix("--help explains all options\n")
    if words in COMMANDS:
        assert re.search(f"^error: .*{COMMANDS[words]}", said), said
        assert said.count("\n") == 1
    else:
        assert re.search(f"error: .*{MANY_RUNS[words]}", said), said
        assert "Traceback" not in said
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {*files}


ARM = s.PlanarArm(5)
SHOWN = Demonstration(np.zeros(0), np.arange(2.0), np.zeros((2, 5)), np.zeros(2))


def learner(**parts):
    return s.sagg_riac(ARM, 0, **parts)


class Silent(s.PlanarArm):
    """Its outcome has no return."""

    execute_many = None

    def execute(self, context, theta, rng):
        super().execute(context, theta, rng)


CALLS = {
    "no inverse": (lambda: learner(inverse=None), "Inverse must be a class or a function, got a NoneType"),
    "a budget of nothing": (lambda: learner(budget=0), "budget must be a whole number >= 1, got 0"),
    "a generator for a seed": (lambda: s.sagg_riac(ARM, stream(0, "a")), "seed must be a whole number >= 0"),
    "a class for an environment": (lambda: s.sagg_riac(s.PlanarArm, 0), r"got the class PlanarArm .* PlanarArm\(\)"),
    "a class in a task": (lambda: Task(s.PlanarArm), "got the class PlanarArm itself"),
    "swapped": (lambda: s.sagg_riac(0, ARM), "an environment is wanted, got a int; is the order of arguments right?"),
    "swapped in a run": (
        lambda: next(s.run(ARM, learner(), 0, movements=3)),
        "learner must be a Learner, got a PlanarArm",
    ),
    "a builder": (lambda: next(s.run(s.sagg_riac, ARM, 0, movements=3)), "learner must be a Learner, got a function"),
    "a list for a teacher": (
        lambda: next(s.run(learner(), ARM, 0, movements=3, teacher=[SHOWN])),
        "teacher must be a Teacher, got a list; try PeriodicTeacher",
    ),
    "failures that are none": (
        lambda: next(s.run(learner(), ARM, 0, movements=3, failures=1.5)),
        "failures must be a whole number >= 1, got 1.5",
    ),
    "a tolerance that is none": (lambda: learner(tolerance=np.nan), "tolerance must .* got nan"),
    "movements that are none": (lambda: next(s.run(learner(), ARM, 0, movements=1e3)), "movements must be a whole"),
    "a pupil that cannot learn": (lambda: learner().watch(SHOWN), "has no social strategy"),
    "no correspondence": (lambda: sgim_d(ARM, 0), "missing 1 required keyword-only argument: 'correspondence'"),
    "one goal": (lambda: evaluate(learner().inverse, ARM, np.zeros(2), 0, 0), "goals must have shape"),
    "corners swapped": (lambda: Box(np.ones(2), np.zeros(2)), "corners with low < high, .* were they swapped?"),
    "a text for names": (lambda: Box(np.zeros(2), np.ones(2), names="xy"), "Box needs 2 names"),
    "an escape code in a name": (lambda: Box.cube(0, 1, 1, names=("x\x1b[31m",)), "without control characters"),
    "a seed for a teacher": (lambda: PeriodicTeacher([SHOWN], 0), "rng must be a numpy.random.Generator, got int"),
    "no return": (
        lambda: execute_many(Silent(5), np.zeros((3, 0)), np.full((3, 5), 0.5), [stream(0, "a", k) for k in range(3)]),
        r"execute\(\) of movement 0 must give numbers of shape \(2,\), got NoneType; is there a return\?",
    ),
}


@pytest.mark.parametrize("what", CALLS)
def test_a_wrong_call_is_refused_with_the_likely_slip(what):
    call, message = CALLS[what]
    with pytest.raises((ValueError, TypeError, RuntimeError), match=message) as raised:
        call()
    assert "\n" not in str(raised.value)
