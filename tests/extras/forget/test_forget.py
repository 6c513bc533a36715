"""``sgimd forget``: movements of a run are taken back, and all that opens the run knows it."""

import numpy as np
import pytest

from runs import content_of
from sgimd_torch.extras.ask.command import main as ask
from sgimd_torch.extras.forget.command import main as forget
from sgimd_torch.extras.report.command import main as report
from sgimd_torch.learner.events import Kind
from sgimd_torch.options.parse import parse
from sgimd_torch.record import Record
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main as live
from sgimd_torch.runs.load import load_learner
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import RunLoop

SHORT = "--environment planar-arm-7 --evaluate-at 30 --repeats 0 --benchmark null --out {} --name {}"
KINDS = {
    "practice": "--algorithm practice",
    "flat": "--algorithm practice --memory flat",
    "taught": "--algorithm sgim-d --teacher.every 7",
    "several robots": "--algorithm practice-taught --at-once 3",
    "asking": "--algorithm sgim-acts",
}
GOALS = np.array([[0.3, 0.4], [-0.4, 0.5]])


def words(out, name, kind, movements):
    return f"{SHORT.format(out, name)} {KINDS[kind]} --movements {movements}".split()


def answers(learner):
    return repr([learner.inverse(np.zeros(0), goal) for goal in GOALS])


@pytest.mark.parametrize("kind", KINDS)
def test_a_resumed_run_equals_a_life_that_forgot_at_the_same_place(kind, tmp_path, capsys):
    parts = build(parse(words(tmp_path, "whole", kind, 90))[0])
    with RunLoop(parts, resume=False) as life:
        for episode in life.episodes():
            if episode.index == 59:
                parts.learner.forget([12, *range(40, 46)])
                at_sixty = answers(parts.learner)
        life.commit()
    assert command(live, words(tmp_path, "run", kind, 60)) == 0
    path, whole = tmp_path / "run/seed-000", tmp_path / "whole/seed-000"
    before = answers(load_learner(path))
    assert command(forget, [str(path), "--movements", "12,40-45"]) == 0
    left = len(load_learner(path).memory)
    assert capsys.readouterr().out.endswith(f"{path}: {left} exemplars are left\n")
    assert answers(load_learner(path)) == at_sixty != before
    assert command(live, [*words(tmp_path, "run", kind, 90), "--resume"]) == 0
    assert content_of(path) == content_of(whole)
    assert answers(load_learner(path)) == answers(load_learner(whole)) == answers(parts.learner)


@pytest.fixture(scope="module")
def forgotten(tmp_path_factory):
    """A run of 60 movements without what four of them taught."""
    out = tmp_path_factory.mktemp("forgotten")
    assert command(live, words(out, "run", "practice", 60)) == 0
    for movements in ("3", "40-42"):
        assert command(forget, [str(out / "run/seed-000"), "--movements", movements]) == 0
    return out / "run/seed-000"


def test_the_record_keeps_the_exemplars_and_all_views_leave_them_out(forgotten, capsys):
    run, gone = read_run(forgotten), [3, 40, 41, 42]
    assert np.flatnonzero(run.forgotten).tolist() == np.flatnonzero(np.isnan(run.outcomes[:, 0])).tolist() == gone
    with Record(forgotten / "run.sqlite") as record:
        events = [*record.events()]
    assert [event.reply for event in events if event.kind == Kind.FORGOTTEN] == ["3", "40-42"]
    moved = np.array([event.outcome for event in events if event.kind == Kind.MOVED])
    assert len(moved) == 60
    kept = np.delete(moved, gone, axis=0)
    assert np.array_equal(load_learner(forgotten).memory.outcomes, kept)
    begun = parse([*words(forgotten.parent, "new", "practice", 20), f"--begin-with={forgotten}/run.sqlite"])[0]
    assert np.array_equal(build(begun).prior.outcomes, kept)
    assert command(ask, [str(forgotten), "--goal", "0.3,0.4"]) == 0
    assert command(report, [str(forgotten)]) == 0
    for said in (capsys.readouterr().err, (forgotten / "report.html").read_text()):
        assert "taken back: movement 3,40-42" in said


def test_the_learner_of_an_earlier_time_still_knew_them(forgotten):
    from sgimd_torch.runs.load import OpenRun

    run = OpenRun(forgotten)
    for movements, exemplars in ((50, 50), (60, 60), (np.inf, 56)):
        run.recall(movements)
        assert len(run.parts.learner.memory) == exemplars


def test_what_is_wrong_is_told_in_a_line_and_the_record_stays(forgotten, tmp_path, capsys):
    content = content_of(forgotten)
    with Record(forgotten / "run.sqlite", write=True):
        assert command(forget, [str(forgotten), "--movements", "5"]) == 2
    for movements in ("3,50,59-999999999999", "60"):
        assert command(forget, [str(forgotten), "--movements", movements]) == 2
    assert command(forget, [str(tmp_path), "--movements", "5"]) == 2
    busy, several, beyond, nowhere = (
        line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")
    )
    assert "run.sqlite is in use by another process; wait for it" in busy
    assert "movement 3 was forgotten before; movement 60 does not exist: 60 were made, from 0 on" in several
    assert beyond == "error: movement 60 does not exist: 60 were made, from 0 on; nothing was forgotten"
    assert "there is no record" in nowhere
    assert content_of(forgotten) == content
