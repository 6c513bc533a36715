"""Lives in processes of their own: each made once, its rows kept."""

from lives import make_lives
from made_lives import ALIVE, life
from table import merge, read_table


def test_lives_that_the_table_has_are_not_made_again_and_the_others_get_their_rows(tmp_path):
    kept = {"number": 1, "learner": "practice", "movements": 2, "error": 9.0, "noticed": 5}
    merge(tmp_path, "random.csv", [kept])
    make_lives(tmp_path, "random.csv", life, ALIVE, processes=1)
    rows = read_table(tmp_path, "random.csv").set_index(["number", "learner", "movements"])
    assert rows.error.to_dict() == {
        (0, "practice", 1): 0.5,
        (0, "practice", 2): 0.25,
        (0, "random", 1): 0.5,
        (0, "random", 2): 0.25,
        (1, "practice", 2): 9.0,
        (1, "random", 1): 0.5,
        (1, "random", 2): 1.25,
    }
    assert rows.noticed[1, "random", 2] == 1
