"""The report of learners that ask: who was asked, by which strategy movements were made, where it asked."""

from shutil import copytree

import numpy as np
import pytest

from pages import rows_of
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.process import command
from sgimd_torch.views.report import asking
from sgimd_torch.views.report import command as report
from sgimd_torch.views.report.data import Variant, demonstrated, read_life

ASKS = "--environment planar-arm-7 --evaluate-at 40 --repeats 0 --evaluated-by own --movements 60"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """One that searches and waits for a slow teacher, one that practises on the toss, one that asks nobody."""
    out = tmp_path_factory.mktemp("asking")
    for options in (
        "--algorithm sgim-acts --teachers low-half,slow --base search --social.repeats 3 --name acts",
        "--algorithm sgim-im --environment toss --name toss",
        "--algorithm practice --name alone",
    ):
        assert command(main, [*ASKS.split(), *options.split(), "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def acts(runs):
    return read_life(runs / "acts" / "seed-000")


@pytest.fixture(scope="module")
def page(runs, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "x.html"
    assert report.main([str(runs), "--out", str(path)]) == 0
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["acts", "toss"])
def test_a_run_whose_log_is_lost_does_not_keep_the_page_from_being_written(runs, tmp_path, name):
    copytree(runs, tmp_path / "runs")
    (tmp_path / "runs" / name / "seed-000" / "episodes.csv").write_text("")
    assert report.main([str(tmp_path / "runs"), "--out", str(tmp_path / "x.html")]) == 0


@pytest.mark.parametrize(("name", "columns"), [("acts", ("got_0", "got_1")), ("toss", ("got_1", "got_2"))])
def test_each_movement_is_that_of_the_last_strategy_whose_demonstration_it_uses(runs, name, columns):
    life = read_life(runs / name / "seed-000")
    found, asked = asking.strategies(life), life.requests
    got, current = np.stack([asked[column] for column in columns], axis=1), None
    for k, (origin, goal) in enumerate(zip(life.origin, life.goals, strict=True)):
        now = np.flatnonzero((asked["index"] == k) & (asked["reply"] == "shown"))
        if (asked["index"] == k).any():
            current = now[0] if len(now) else None
        if current is not None and origin not in ("", "imitate") and (goal != got[current]).any():
            current = None
        assert found[k] == ("autonomous" if current is None else asked["strategy"][current]), k
    assert ("autonomous" in found) == (name == "toss")
    assert (life.origin == "").any() == (name == "acts")  # it rested for the slow one
    assert not (found[np.isin(life.origin, ("", "imitate"))] == "autonomous").any()


def test_the_page_counts_the_requests_to_each_teacher(page, acts):
    head, *rows = rows_of(page, "Requests for a demonstration")
    assert head[:7] == ["teacher", "requests", "shown", "again", "nothing", "failed", "timed out"]
    lines = {row[0]: dict(zip(head[1:], row[1:], strict=True)) for row in rows}
    assert lines.keys() == {*(f"acts: {name}" for name in {*acts.requests["teacher"]}), "toss: all"}
    mine = acts.requests["teacher"] == "low-half"
    shown = mine & (acts.requests["reply"] == "shown")
    assert lines["acts: low-half"]["requests"] == str(mine.sum())
    assert lines["acts: low-half"]["shown"] == str(shown.sum())
    apart = np.median(acts.requests["apart_m"][shown])
    assert lines["acts: low-half"]["shown this far from the goal (m), median"] == f"{apart:.3f}"
    brought = acts.requests["brought"][shown]
    raised = np.mean(brought[np.isfinite(brought)])
    assert lines["acts: low-half"]["a demonstration raised the competence at the goal by"] == f"{raised:.3f}"


def test_the_page_shows_strategies_over_time_and_goals_of_those_who_ask_only(page):
    for name in ("acts", "toss"):
        assert page.count(f'alt="Strategies of {name} over time"') == 1
        assert page.count(f'alt="Goals that {name} asked for"') == 1
    assert "Strategies of alone" not in page
    assert "What they were shown is left out" not in page


def test_the_share_of_goals_that_were_asked_for_in_a_region_by_hand():
    asked, own = np.array([[0.1, 0.1], [0.9, 0.9]]), np.array([[0.2, 0.2], [0.3, 0.3], [0.4, 0.4], [np.nan, np.nan]])
    assert asking._share(asked, own, np.zeros(2), np.full(2, 0.5)) == pytest.approx(25.0)
    assert np.isnan(asking._share(asked, own, np.full(2, -1.0), np.full(2, -0.5)))


def test_what_was_shown_is_taken_from_the_requests(acts):
    outcomes, missing = demonstrated([acts])
    assert missing == ""
    shown = acts.requests["reply"] == "shown"
    wanted = np.stack([acts.requests["got_0"], acts.requests["got_1"]], axis=1)[shown]
    assert sorted(outcomes.tolist()) == sorted(wanted.tolist())


def test_a_variant_that_asks_nobody_has_no_rows(runs):
    alone = Variant("alone", [read_life(runs / "alone" / "seed-000")])
    assert asking.requests_of([alone]).rows == []
    assert not asking.asks(alone.typical)
