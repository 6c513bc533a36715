"""The printer of every command's table."""

import pytest

from sgimd_torch.views.text_table import print_table


def test_columns_are_as_wide_as_their_widest_cell_and_lines_end_with_text(capsys):
    print_table([("task", "error (m)", "seeds"), ("planar-arm-50", "0.1", "3"), ("toss", "0.25", "")])
    assert capsys.readouterr().out.splitlines() == [
        "task           error (m)  seeds",
        "planar-arm-50  0.1        3",
        "toss           0.25",
    ]


def test_a_row_that_lacks_a_cell_is_refused():
    with pytest.raises(ValueError, match="zip"):
        print_table([("task", "error"), ("toss",)])
