"""The bars of learning from few movements, and the tables that stand in results/LEARNING.md."""

import numpy as np
import pytest

from claims import main
from judging import judge
from learning_claims import LEARNING_CLAIMS, TAUGHT_RIVALS, answers_rows, read_learning, suite_rows
from paper import HEADER, SEEDS, spread
from sgimd_torch.runs.process import command
from sgimd_torch.views.suite import TASKS
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


def write(folder, *, floor=0.0295, linear=2.0, tasks=TASKS, suite=1.0, **spoilt):
    """``spoilt``: variant of the rod, without ".rod" and with _ for -, to errors in the place of the true ones."""
    errors = {**TRUE, **{f"{name.replace('_', '-')}.rod": given for name, given in spoilt.items()}}
    lines = [
        row("learning", name, seed, when, answer, error * (linear if answer == "linear" else 1), floor)
        for name, curve in errors.items()
        for seed in range(SEEDS)
        for when, error in zip(TIMES, curve, strict=True)
        for answer in PROVED
    ]
    (folder / "learning.csv").write_text("\n".join([HEADER, *lines]) + "\n")
    lines = [
        row("suite", name, seed, when, answer, suite * (2.0 if name.startswith("random") else 1.0))
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
    ],
)
def test_a_bar_that_is_missed_does_not_hold(tmp_path, claim, spoilt):
    assert verdicts(write(tmp_path, **spoilt))[LEARNING_CLAIMS[claim].text] == "does not hold"


def test_the_suite_is_told_in_random_movements_and_has_dashes_where_nothing_was_run(tmp_path):
    suite = read_learning(write(tmp_path, tasks=("toss", "crawler"), suite=0.25) / "suite.csv")
    *rows, mean = suite_rows(suite, 1000)
    lines = {cells[0]: cells[1:] for cells in rows}
    assert list(lines) == [name + " (new)" * task.new for name, task in TASKS.items()]
    assert lines["crawler (new)"][0].startswith("0.500")
    assert [cell[:4] for cell in lines["crawler (new)"][1:]] == ["0.50"] * 4
    assert lines["toss"][-2:] == ["-", "-"]  # quality diversity knows no context
    assert set(lines["rod"]) == {"-"}
    assert mean[2:] == ["0.50"] * 4


def test_answers_are_compared_on_the_same_memory(tmp_path):
    rows = answers_rows(read_learning(write(tmp_path) / "learning.csv"))
    assert ["`sagg-riac`", "`linear`", *["0.50"] * 5] in rows
    assert ["`sagg-riac`", "`nearest`", *["1.00"] * 5] in rows
    assert len(rows) == 2 * len(LEARNING)


def test_the_page_has_the_verdicts_and_every_task(tmp_path, capsys):
    folder = write(tmp_path)
    assert command(main, ["--results", str(folder), "--out", str(tmp_path / "pages"), "--only", "LEARNING"]) == 0
    assert f"{len(LEARNING_CLAIMS)} claims: {len(LEARNING_CLAIMS)} holds" in capsys.readouterr().out
    page = (tmp_path / "pages/LEARNING.md").read_text()
    assert all(claim.text in page for claim in LEARNING_CLAIMS)
    assert page.count("| spatial-arm (new) |") == 4
    assert "(not run)" not in page
    assert np.all([f"After {when} movements" in page for when in TIMES[:4]])
