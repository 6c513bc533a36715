"""Pictures on the board: what they show, when they are drawn, and that a resumed run has the same."""

import numpy as np
import pytest
from matplotlib import rc_context

from boards import ANY_OUTCOMES, board_of, board_of_any, pictures_of
from marks import slow
from sgimd_torch.extras.pictures import pictures
from sgimd_torch.spaces import Box, stream
from worlds import interest_map


@pytest.mark.parametrize(
    ("high", "context", "worst"),
    [slow((1.0, 1.0), (), -1.0), ((4.0, 0.8), (), -1.0), ((4.0, 1.73), (0,), -0.6), slow((0.7, 0.98), (), -1.0)],
)
def test_pictures_tell_small_errors_apart_and_cut_off_no_label(high, context, worst):
    space = Box(np.array([-0.3, -0.42]), np.array(high), ("tip x", "tip y"), "m")
    goals = space.low + space.sides * stream(0, "goals").random((4, 2))
    regions, contexts = interest_map(space=space, context=context, worst=worst).regions, Box.cube(0, 1, len(context))
    drawn = {}
    for error in (0.01, 0.02, 0.2):
        maps = pictures.maps_of(regions, space, contexts, goals, np.array([0.0, error, error, error]), [])
        drawn[error] = maps["map/error"]
        for pixels in maps.values():
            assert all((edge == 255).all() for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]))
    half = drawn[0.01].shape[1] // 2
    shown = pictures.maps_of(regions, space, contexts, goals, np.array([0.0, error, error, error]), [space.high * 0.5])
    assert {tag for tag in maps if (maps[tag] != shown[tag]).any()} == {"map/error"}  # which has the demonstrations
    for less, more in ((0.01, 0.02), (0.02, 0.2)):
        assert (drawn[less] != drawn[more])[40:, :half].any()  # below the title, left of the colour bar


def test_pictures_do_not_depend_on_the_matplotlibrc_of_the_user():
    space, goals = Box.cube(-1, 1, 2), stream(0, "goals").random((4, 2))
    drawn = []
    for settings in ({}, {"text.usetex": True, "font.size": 30}):  # there need be no LaTeX
        with rc_context(settings):
            drawn.append(pictures.maps_of([], space, Box.cube(0, 1, 0), goals, goals[:, 0], [])["map/error"])
    assert np.array_equal(*drawn)


OPTIONS = ("--movements", "160", "--evaluate_at", "10,60,80", "--board", "true")


def test_pictures_are_drawn_when_there_were_eight_times_as_many_movements_and_at_the_end_also_after_a_resume(
    tmp_path, go
):
    assert go(tmp_path / "whole", *OPTIONS) == 0
    assert go(tmp_path / "parts", "--movements", "100", "--evaluate_at", "10,60") == 0
    assert go(tmp_path / "parts", *OPTIONS, "--resume") == 0
    whole, parts = (tmp_path / name / "sgim-d/seed-003" for name in ("whole", "parts"))
    drawn = pictures_of(whole)
    assert drawn.keys() == {"map/error", "map/regions", "map/interest"}
    assert all(png.startswith(b"\x89PNG") for png in drawn["map/error"].values())
    assert drawn["map/error"].keys() == {10, 80, 160}
    assert pictures_of(parts) == drawn
    assert all(board_of(whole).SummaryMetadata(tag).summary_description for tag in drawn)


@pytest.mark.parametrize("robot", ANY_OUTCOMES)
def test_outcomes_of_any_dimension_or_named_like_a_formula_have_pictures(own, module, robot):
    assert pictures_of(board_of_any(robot, module)).keys() == {"map/error", "map/regions", "map/interest"}


def test_a_picture_that_fails_ends_no_run(tmp_path, go, monkeypatch, capsys):
    def no_font(*_):
        raise OSError("no font")

    monkeypatch.setattr(pictures, "maps_of", no_font)
    assert go(tmp_path, *OPTIONS) == 0
    assert "the board has no pictures after 10 movements: OSError: no font" in capsys.readouterr().err
