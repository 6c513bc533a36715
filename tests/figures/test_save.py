"""A figure as files: in our style, the same again, all of it or none."""

from functools import partial

import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from sgimd_torch.figures.save import STYLE, save_figure


def a_line(values):
    figure = Figure()
    figure.add_subplot().plot(values)
    figure.text(0.5, 0.5, f"{rcParams['font.size']:g} pt")
    return figure


def test_every_kind_is_written_whole_in_our_style_and_the_same_again(tmp_path):
    first, again = (
        [path.read_bytes() for path in save_figure(partial(a_line, [1, 2]), tmp_path / out, "png", "svg")]
        for out in ("a.b", "again")
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.b.png", "a.b.svg", "again.png", "again.svg"]
    assert first == again
    assert first[0].endswith(b"IEND\xaeB`\x82")
    assert f"{STYLE['font.size']} pt".encode() in first[1]
    assert rcParams["font.size"] != STYLE["font.size"]


def test_a_figure_that_cannot_be_drawn_leaves_the_old_file(tmp_path):
    (path,) = save_figure(partial(a_line, [1, 2]), tmp_path / "a", "png")
    old, broken = path.read_bytes(), Figure()
    broken.text(0.5, 0.5, r"$\frac$")  # no formula, which shows only when it is drawn
    with pytest.raises(ValueError, match="frac"):
        save_figure(lambda: broken, tmp_path / "a", "png")
    assert path.read_bytes() == old
    assert [each.name for each in tmp_path.iterdir()] == ["a.png"]
