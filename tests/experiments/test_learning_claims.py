"""The bars of learning from few movements and of the suite, and the tables that stand in results/LEARNING.md."""

import numpy as np
import pytest

from claims import main
from judging import judge
from learning_claims import LEARNING_CLAIMS, TAUGHT_RIVALS, answers_rows, read_learning
from paper import HEADER, SEEDS, spread
from sgimd_torch.runs.process import command
from sgimd_torch.views.suite import TASKS
from suite_claims import read_suite, suite_claims, suite_rows
from variants import EXPERIMENTS, LEARNING, PROVED

TIMES = (250, 500, 1000, 2000, 5000)
BEST = (0.09, 0.06, 0.04, 0.036, 0.03)
TRUE = {
    **dict.fromkeys(LEARNING, (0.2, 0.17, 0.15, 0.13, 0.12)),
    "practice-taught.rod": BEST,
    "practice-corner.rod": BEST,
    "practice-shuffled.rod": BEST,
    "practice.rod": (0.1, 0.07, 0.05, 0.04, 0.036),
    "cma-mae.rod": (0.3, 0.2, 0.1, 0.08, 0.07),
    "sgim-d.rod": (0.2, 0.1, 0.07, 0.05, 0.045),
    "sgim-d-uniform.rod": (0.2, 0.1, 0.08, 0.06, 0.05),
}


def row(experiment, variant, seed, movements, answer, error, floor=""):
    return f"{experiment},{variant},,1,{seed},{movements},{answer},{error * spread(seed)},{floor},1,1,1"


ON_SUITE = {"random-nearest": 2.0, "uniform-nearest": 1.5, "practice": 1.0, "cma-mae": 1.4, "map-elites": 1.3}


def write(folder, *, floor=0.0295, linear=2.0, by_model=1.0, tasks=TASKS, suite=None, **spoilt):
    """``by_model``: how much worse the own answer is where it has a model. ``suite``: (variant, movements, answer) to a
    factor. ``spoilt``: variant of the rod, without ".rod" and with _ for -, to errors in the place of the true ones."""
    on_rod = suite or (lambda name, when, answer: 1.0)
    on_suite = suite or (lambda name, when, answer: 1.2 if answer == "linear" else 1.0)
    errors = {**TRUE, **{f"{name.replace('_', '-')}.rod": given for name, given in spoilt.items()}}
    lines = [
        row("learning", name, seed, when, answer, error * factor[answer] * on_rod(name, when, answer), floor)
        for name, curve in errors.items()
        for seed in range(SEEDS)
        for when, error in zip(TIMES, curve, strict=True)
        for answer in PROVED
        for factor in [
            {**dict.fromkeys(PROVED, 1), "linear": linear, "own": by_model if name == "imitation.rod" else 1}
        ]
    ]
    (folder / "learning.csv").write_text("\n".join([HEADER, *lines]) + "\n")
    lines = [
        row(
            "suite",
            name,
            seed,
            when,
            answer,
            ON_SUITE[name.partition(".")[0]] * on_suite(name, when, answer) * 50 / when,
        )
        for name in EXPERIMENTS["suite"]
        if name.partition(".")[2] in tasks
        for seed in range(SEEDS)
        for when in TIMES[:4]
        for answer in PROVED
    ]
    (folder / "suite.csv").write_text("\n".join([HEADER, *lines]) + "\n")
    return folder


def verdicts(folder):
    return {
        found.claim: found.verdict for found in judge(LEARNING_CLAIMS, read_learning(folder / "learning.csv")["judged"])
    }


def test_where_every_bar_is_cleared_every_one_holds(tmp_path):
    assert set(verdicts(write(tmp_path)).values()) == {"holds"}


@pytest.mark.parametrize(
    ("claim", "spoilt"),
    [
        (0, {"practice_taught": (0.11, 0.06, 0.04, 0.036, 0.03)}),
        (1, {"practice_taught": (0.09, 0.06, 0.04, 0.036, 0.034)}),
        (2, {"floor": 0.028}),
        (3, {"practice_taught": (0.09, 0.06, 0.04, 0.036, 0.039)}),
        (4, {"cma_mae": (0.3, 0.2, 0.1, 0.08, 0.034)}),
        (5, {TAUGHT_RIVALS[1].removesuffix(".rod"): (0.09, 0.05, 0.05, 0.04, 0.04)}),
        (6, {"sgim_d": (0.2, 0.1, 0.035, 0.05, 0.045)}),
        (7, {"sgim_d_uniform": (0.2, 0.1, 0.08, 0.06, 0.04)}),
        (8, {"practice_corner": (0.11, 0.06, 0.04, 0.036, 0.03)}),
        (9, {"practice_shuffled": (0.09, 0.06, 0.04, 0.036, 0.04)}),
        (10, {"practice_shuffled": (0.11, 0.06, 0.04, 0.036, 0.03)}),
        (11, {"by_model": 1.1}),
        (12, {"uniform_nearest_taught": (0.2, 0.1, 0.08, 0.06, 0.04)}),
    ],
)
def test_a_bar_that_is_missed_does_not_hold(tmp_path, claim, spoilt):
    assert verdicts(write(tmp_path, **spoilt))[LEARNING_CLAIMS[claim].text] == "does not hold"


def judged_on_suite(folder, **changed):
    suite = read_suite(write(folder, **changed))
    return [found.verdict for found in judge(suite_claims(suite), suite["process"])]


def test_where_every_bar_of_the_suite_is_cleared_every_one_holds(tmp_path):
    assert judged_on_suite(tmp_path) == ["holds"] * 8


@pytest.mark.parametrize(
    ("claim", "worse"),
    [
        (0, lambda name, when, answer: 2.2 if (name, when, answer) == ("practice.toss", 500, "process") else 1),
        (1, lambda name, when, answer: 1.7 if (name, when, answer) == ("practice.swimmer", 250, "process") else 1),
        (2, lambda name, when, answer: 0.8 if name.startswith("uniform") and when == 1000 else 1),
        (3, lambda name, when, answer: 0.8 if (name[:7], when, answer) == ("uniform", 1000, "process") else 1),
        (4, lambda name, when, answer: 0.6 if name.startswith("map-elites") and when == 2000 else 1),
        (5, lambda name, when, answer: 5 if (name, when) == ("practice.crawler", 2000) else 1),
        (6, lambda name, when, answer: 0.9 if (name, answer) == ("cma-mae.spatial-arm", "nearest") else 1),
        (7, lambda name, when, answer: 0.9 if (name, answer) == ("map-elites.rod", "linear") else 1),
    ],
)
def test_a_bar_of_the_suite_that_is_missed_does_not_hold(tmp_path, claim, worse):
    assert judged_on_suite(tmp_path, suite=worse, linear=1.0)[claim] == "does not hold"


def test_without_the_rows_of_a_task_the_suite_cannot_say(tmp_path):
    assert set(judged_on_suite(tmp_path, tasks=[name for name in TASKS if name != "crawler"])) == {"cannot say"}


def test_the_suite_is_told_in_random_movements_and_has_dashes_where_nothing_was_run(tmp_path):
    suite = read_suite(write(tmp_path, tasks=("toss", "crawler")))
    *rows, mean = suite_rows(suite, 1000)
    lines = {cells[0]: cells[1:] for cells in rows}
    assert list(lines) == [name + " (new)" * task.new for name, task in TASKS.items()]
    assert lines["crawler (new)"][:2] == [str(SEEDS), "0.100 [0.100, 0.100]"]
    assert [cell[:4] for cell in lines["crawler (new)"][2:]] == ["0.75", "0.75", "0.50", "0.70", "0.65"]
    assert lines["toss"][-2:] == ["-", "-"]  # quality diversity knows no context
    assert set(lines["planar-arm-7 (new)"]) == {"0", "-"}
    assert lines["rod"][1].startswith("0.150")  # of the other table
    assert mean[1:4] == ["", "", "0.83"]  # of three tasks, with the rod


def test_answers_are_compared_on_the_same_memory(tmp_path):
    rows = answers_rows(read_learning(write(tmp_path) / "learning.csv"))
    assert ["`sagg-riac`", "`linear`", *["0.50"] * 5] in rows
    assert ["`sagg-riac`", "`nearest`", *["1.00"] * 5] in rows
    assert len(rows) == 2 * len(LEARNING)


def test_the_page_has_the_verdicts_and_every_task(tmp_path, capsys):
    folder = write(tmp_path)
    assert command(main, ["--results", str(folder), "--out", str(tmp_path / "pages"), "--only", "LEARNING"]) == 0
    assert f"{len(LEARNING_CLAIMS) + 8} claims:" in capsys.readouterr().out
    page = (tmp_path / "pages/LEARNING.md").read_text()
    assert all(claim.text in page for claim in LEARNING_CLAIMS)
    assert page.count("| spatial-arm (new) |") == 4
    assert "(not run)" not in page
    assert np.all([f"After {when} movements" in page for when in TIMES[:4]])
