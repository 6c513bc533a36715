"""What outcomes tell of a robot is told by the check, by a run, and by all that shows the run."""

import numpy as np
import pytest

from sgimd_torch.__main__ import _call
from sgimd_torch.extras.check.remarks import remarks_on
from sgimd_torch.runs.program import command
from sgimd_torch.spaces import Box, stream
from worlds import Boxes

SPREAD = stream(0, "outcomes").uniform(-1, 1, (60, 2))
CASES = {
    "": SPREAD,
    "equal": np.concatenate([SPREAD, np.tile(SPREAD[:1], (50, 1))]),
    "still": 0.3 + 0.01 * stream(1, "noise").standard_normal((60, 2)),
    "flat": SPREAD * [1, 0],
    "clipped": np.clip(1.3 * SPREAD, -1, 1),
    "far": np.where(np.arange(60)[:, None] % 20, SPREAD, 30.0),
    "outside": 1000 + SPREAD,
    "narrow": 0.1 * SPREAD,
}
HARMLESS = {
    "a few equal ones after others": np.concatenate([SPREAD, np.tile(SPREAD[:1], (49, 1))]),
    "few outcomes": SPREAD[:9] * 0,
    "misses that end at rest": np.where(SPREAD < 0, 0.0, SPREAD),
    "a farther past": np.concatenate([1000 + SPREAD, *[SPREAD] * 9]),
}


def robot(low=-1.0):
    return Boxes(Box.cube(0, 1, 0), Box.cube(0, 1, 2), Box.cube(low, 1, 2, names=("x", "y")), np.zeros(2), 0.01)


@pytest.mark.parametrize("kind", CASES)
def test_each_kind_is_told_and_no_other(kind):
    assert [*remarks_on(robot(), CASES[kind])] == [kind] * bool(kind)


@pytest.mark.parametrize("case", HARMLESS)
def test_what_is_right_is_not_suspected(case):
    assert not remarks_on(robot(low=0.0 if "rest" in case else -1.0), HARMLESS[case])


def test_a_dimension_that_never_changes_is_named():
    assert remarks_on(robot(), CASES["flat"])["flat"].startswith("y changes by no more than noise")


DEAD = """
from sliders import Slider

class Dead(Slider):
    outcome_noise = 0.0

    def execute(self, context, theta, rng):
        return 0 * super().execute(context, theta, rng) + 0.25
"""


def test_a_dead_sensor_is_told_by_the_check_once_by_a_run_and_by_all_that_shows_it(own, module, capsys):
    module("dead", DEAD)
    said = "outcomes are equal, [0.25]: is a sensor dead, or does no movement move what is measured?"
    assert command(_call, ["check", "dead:Dead"]) == 0
    assert f"  the last 20 {said}\n" in capsys.readouterr().out
    live = ["run", "--environment=dead:Dead", "--algorithm=random", "--evaluate-at=[]", "--out=runs", "--movements"]
    assert command(_call, [*live, "100"]) == 0
    assert capsys.readouterr().err.count(f"the last 50 {said}") == 1
    assert command(_call, [*live, "150", "--resume"]) == 0
    assert said not in capsys.readouterr().err
    for view in ("table runs", "ask runs/random/seed-000 --trust --goal 0.5"):
        assert command(_call, view.split()) == 0
        assert f"runs/random/seed-000: the last 150 {said}\n" in capsys.readouterr().err
    assert command(_call, ["report", "runs", "--out", "page.html"]) == 0
    assert f"the last 150 {said}" in (own / "page.html").read_text()


@pytest.mark.parametrize(
    ("degrees", "periodic", "is_told"), [(360, (), True), (360, (True, False), False), (300, (), False)]
)
def test_an_outcome_that_spans_a_whole_turn_may_wrap(degrees, periodic, is_told):
    space = Box([0, -1], [degrees, 1], ("heading", "y"), periodic=periodic)
    told = remarks_on(
        Boxes(Box.cube(0, 1, 0), Box.cube(0, 1, 2), space, np.zeros(2), 0.01), (SPREAD + 1) * [180, 1] - [0, 1]
    )
    assert ("heading spans a whole turn, up to both ends" in told.get("wraps", "")) == is_told
