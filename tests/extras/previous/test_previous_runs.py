"""``sgimd run --context previous``: the theta of the movement before is the context; a run says if it needs that."""

import numpy as np

from sgimd_torch.extras.ask import command as ask
from sgimd_torch.runs.command import main
from sgimd_torch.runs.load import load_learner
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run

SAID = "outcomes depend on the movement before"


def go(out, *words):
    return command(main, ["--environment=finger:Finger", "--evaluate-at=[]", f"--out={out}", *words])


def test_a_run_says_once_that_its_robot_has_a_memory_unless_it_knows_the_movement_before(tmp_path, capsys):
    assert go(tmp_path / "without", "--movements=110") == 0
    assert capsys.readouterr().err.count(SAID) == 1
    assert go(tmp_path / "with", "--movements=110", "--context=previous") == 0
    assert go(tmp_path / "arm", "--movements=110", "--environment=planar-arm-7") == 0
    assert SAID not in capsys.readouterr().err


def test_each_context_is_the_theta_before_also_where_the_run_goes_on_or_is_asked(tmp_path, capsys):
    words = ["--context=previous", "--movements"]
    assert go(tmp_path, *words, "40") == 0
    assert go(tmp_path, *words, "60", "--resume") == 0
    path = tmp_path / "practice" / "seed-000"
    run, middle = read_run(path), np.full(3, 0.5)
    before = np.vstack((middle, run.thetas[:-1]))
    before[40] = middle  # nobody knows where the finger was when the second program began
    assert np.array_equal(run.contexts, before)
    last = ",".join(map(repr, run.thetas[-1].tolist()))
    assert command(ask.main, [str(path), "--trust", "--goal=120,30", f"--context={last}"]) == 0
    answer = load_learner(path, trust=True).inverse(run.thetas[-1], [120.0, 30.0])
    assert f"theta {','.join(f'{x:.4g}' for x in answer.theta)};" in capsys.readouterr().out


def test_several_robots_at_once_and_another_context_on_resume_are_refused(tmp_path, capsys):
    assert go(tmp_path, "--movements=40", "--context=previous", "--at-once=2") == 2
    assert "at_once must be at most 1, the at_once of Finger" in capsys.readouterr().err
    assert go(tmp_path, "--movements=10") == 0
    assert go(tmp_path, "--movements=20", "--context=previous", "--resume") == 2
    assert "context was None, now previous" in capsys.readouterr().err
