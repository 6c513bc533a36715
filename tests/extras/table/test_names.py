"""Names and colours of algorithms."""

import re

from sgimd_torch.extras.table.names import COLOURS, NAMES, colour, label


def test_algorithms_have_a_name_and_a_colour_and_unknown_ones_their_word():
    assert label("sgim-d") == "SGIM-D"
    assert label("mine:Own") == "mine:Own"
    assert re.fullmatch("#[0-9a-f]{6}", colour("sgim-d"))
    assert len({colour(word) for word in ("random", "sagg-riac", "observation", "imitation", "sgim-d")}) == 5


def test_every_algorithm_has_a_name_and_a_colour_of_its_own():
    assert set(COLOURS) == set(NAMES) >= {"random", "sagg-riac", "imitation", "observation", "sgim-d"}
    assert len(set(COLOURS.values())) == len(COLOURS)
