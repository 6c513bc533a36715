"""The figures of the results: what they show, read back from their axes, and what happens without their rows."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from evidence import Evidence, NotRun
from figures import FIGURES, main
from made_lives import write_lives
from made_up import MOVEMENTS, write_rows
from marks import slow
from page_tables import GAIN
from sgimd_torch.extras.table.names import COLOURS, NAMES
from sgimd_torch.runs.program import command

NOT_MADE_UP = ("middle", "middle-process")
pytestmark = pytest.mark.usefixtures("few_draws")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_lives(write_rows(tmp_path_factory.mktemp("results")), robots=20, seeds=5)


@pytest.fixture(scope="module")
def found(folder):
    return Evidence.of(folder)


def draw(*options):
    """The exit code of the command."""
    return command(main, list(map(str, options)))


@pytest.mark.slow
def test_every_figure_is_written_whole_and_twice_the_same(folder, tmp_path, capsys):
    for out in ("a", "b"):
        assert draw("--results", folder, "--out", tmp_path / out) == 0
    assert {path.name for path in (tmp_path / "a").iterdir()} == {f"{name}.svg" for name in FIGURES}
    for name in FIGURES:
        text = (tmp_path / "a" / f"{name}.svg").read_text()
        assert text.rstrip().endswith("</svg>")
        assert text == (tmp_path / "b" / f"{name}.svg").read_text()
    said = capsys.readouterr()
    assert f"{tmp_path / 'a' / 'learning.svg'}" in said.out
    assert all(f"left out; not run: {name} at 1000" in said.err for name in NOT_MADE_UP)


def test_a_curve_is_the_mean_over_seeds_in_the_colour_of_its_algorithm_with_its_name_at_the_end(found):
    (ax,) = FIGURES["learning"](found).axes
    lines = {line.get_label(): line for line in ax.lines}
    line = lines[NAMES["practice"]]
    assert to_hex(line.get_color()) == COLOURS["practice"]
    np.testing.assert_array_equal(line.get_xdata(), MOVEMENTS)
    means = [found.error("practice", at, level=None).value for at in MOVEMENTS]
    np.testing.assert_allclose(line.get_ydata(), means)
    heights = sorted(text.get_position()[1] for text in ax.texts)
    assert len(heights) == len(lines) == 6
    assert np.diff(heights).min() > 0.05 * ax.get_ylim()[1]  # no two names overlap


def test_each_step_of_the_gain_that_was_run_has_a_row_from_the_top(found):
    (ax,) = FIGURES["gain"](found).axes
    labels = [label.get_text() for label in ax.get_yticklabels()]
    steps = [step.replace("`", "") for step in GAIN]
    assert labels == [step for step in steps if step in labels]
    points = {line.get_ydata()[0]: line.get_xdata()[0] for line in ax.lines if line.get_marker() == "o"}
    assert points[0] == found.error("random", 1000).value
    assert ax.get_ylim()[0] > ax.get_ylim()[1]


@pytest.mark.parametrize(
    ("missing", "left_out"), [("sagg-riac-large", {"paper"}), slow("practice-taught", {"learning"})]
)
def test_only_those_figures_are_left_out_that_need_a_variant(tmp_path, capsys, missing, left_out):
    folder = write_lives(write_rows(tmp_path, without=[missing]), robots=10, seeds=2)
    for name in left_out:
        with pytest.raises(NotRun, match=missing):
            FIGURES[name](Evidence.of(folder))
        assert draw("--results", folder, "--out", tmp_path / "out", "--only", name) == 0
        assert f"{name} is left out; not run: {missing}" in capsys.readouterr().err
    for name in {*FIGURES} - left_out:
        assert FIGURES[name](Evidence.of(folder)).axes


def test_the_shares_of_the_learners_that_are_best_add_up_to_one(found):
    best, harmed = FIGURES["shares"](found).axes
    assert {line.get_label() for line in harmed.lines} == {NAMES["practice"], NAMES["random"]}
    np.testing.assert_allclose(np.sum([line.get_ydata() for line in best.lines], axis=0), 1)


def test_a_profile_begins_with_the_share_of_robots_on_which_a_learner_is_best_and_never_falls(found):
    for ax in FIGURES["profile"](found).axes:
        lines = {line.get_label(): line.get_ydata() for line in ax.lines}
        assert lines[NAMES["practice"]][0] == 1
        assert lines[NAMES["random"]][0] == 0
        assert lines[NAMES["random"]][-1] == 1  # 1 / .3 of the best
        assert all((np.diff(line) >= 0).all() for line in lines.values())


def test_a_cell_has_the_error_after_a_change_over_that_of_starting_anew(found):
    rod, robots = FIGURES["changes"](found).axes
    assert [len({text.get_position()[0] for text in ax.texts}) for ax in (rod, robots)] == [3, 4]
    assert {text.get_text() for text in robots.texts} == {"0.40"}
