"""A figure as a file: in our style, the same again, all of it or none."""

from functools import partial

import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from sgimd_torch.extras.report.save import STYLE, save_figure


def figure_of(text):
    figure = Figure()
    figure.add_subplot().plot([1, 2])
    figure.text(0.5, 0.5, f"{text} {rcParams['font.size']:g} pt", parse_math="frac" in text)
    return figure


@pytest.mark.parametrize(("kind", "sign"), [("png", b"IEND\xaeB`\x82"), ("svg", f"{STYLE['font.size']} pt".encode())])
def test_a_figure_is_written_whole_in_our_style_and_the_same_again_or_the_old_file_stays(tmp_path, kind, sign):
    paths = [tmp_path / f"{name}.{kind}" for name in ("a.b", "again")]
    for path in paths:
        save_figure(partial(figure_of, "text of"), path)
    with pytest.raises(ValueError, match="frac"):  # no formula, which shows only when it is drawn
        save_figure(partial(figure_of, r"$\frac$"), paths[1])
    assert sorted(tmp_path.iterdir()) == paths
    first, again = (path.read_bytes() for path in paths)
    assert first == again
    assert sign in first
    assert rcParams["font.size"] != STYLE["font.size"]
