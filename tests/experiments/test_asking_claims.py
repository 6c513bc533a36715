"""The bars of learners that ask, on made-up rows, and the page results/ASKING.md."""

import numpy as np
import pytest

from asking_claims import ASKING_CLAIMS, SINGLE, contexts_rows, read_asking, teachers_rows
from claims import main
from judging import judge
from paper import HEADER, SEEDS, spread
from read_results import ASKED_HEADER, CONTEXTS_HEADER, ResultsError, read_asked, read_contexts
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import Run
from tables import ROWS, context_rows
from variants import EXPERIMENTS, FOUR, tables_of

TIMES = (250, 500, 1000, 2000, 5000)
GOOD, WORSE = (0.1, 0.07, 0.04, 0.036, 0.03), (0.2, 0.15, 0.07, 0.06, 0.046)
ALONE = ("taught-every-30", "taught-at-start", "taught-at-start-once", "alone", "alone-toss", "alone-toss-blind")
TRUE = {
    **dict.fromkeys(EXPERIMENTS["asking"], GOOD),
    **dict.fromkeys((*ALONE, "sgim-eer", "sgim-eer-mixture"), WORSE),
}
# requests, shown, late, late_own, strong, weak
ASKED = {
    **{name: {"all": (140, 110, 60, 60, 50, 40)} for name in EXPERIMENTS["asking"] if name not in ALONE},
    "sgim-im-83": {"all": (100, 83, 10, 10, 0, 0)},
    "sgim-im-cost-10": {"all": (60, 50, 20, 20, 0, 0)},
    "sgim-acts-four": {**dict.fromkeys(FOUR[:3], (50, 40, 20, 0, 0, 0)), "mislabelling": (9, 8, 1, 0, 0, 0)},
    "sgim-acts-halves": {"low-half": (50, 40, 20, 19, 0, 0), "high-half": (50, 40, 30, 28, 0, 0)},
}


def write(folder, *, asked=None, without=(), **spoilt):
    """``spoilt``: variant, with _ for -, to errors in the place of the true ones; ``asked``: to other requests."""
    errors = {**TRUE, **{name.replace("_", "-"): given for name, given in spoilt.items()}}
    lines = [
        f"asking,{name},,1,{seed},{when},{answer},{error * spread(seed)},,1,1,1"
        for name, curve in errors.items()
        if name not in without
        for seed in range(SEEDS)
        for when, error in zip(TIMES, curve, strict=True)
        for answer in ("own", "process")
    ]
    (folder / "asking.csv").write_text("\n".join([HEADER, *lines]) + "\n")
    lines = [
        f"{variant},{seed},{teacher},{','.join(map(str, (found[0] + seed % 3, *found[1:])))}"
        for variant, teachers in {**ASKED, **(asked or {})}.items()
        if variant not in without
        for seed in range(SEEDS)
        for teacher, found in teachers.items()
    ]
    (folder / "asked.csv").write_text("\n".join([",".join(ASKED_HEADER), *lines]) + "\n")
    lines = [
        f"{name},{seed},{when},{answer},{low},{low + 2},{factor * abs(low + 1) + 0.04}"
        for name, factor in (("alone-toss", 0.02), ("sgim-im-toss", 0.01))
        for seed in range(SEEDS)
        for when in (1000, 2000)
        for answer in ("own", "process")
        for low in (-3.0, -1.0, 1.0)
    ]
    (folder / "contexts.csv").write_text("\n".join([",".join(CONTEXTS_HEADER), *lines]) + "\n")
    return folder


def verdicts(folder):
    return [found.verdict for found in judge(ASKING_CLAIMS, read_asking(folder))]


def test_where_every_bar_is_cleared_every_one_holds(tmp_path):
    assert verdicts(write(tmp_path)) == ["holds"] * len(ASKING_CLAIMS)


@pytest.mark.parametrize(
    ("claim", "spoilt"),
    [
        (0, {"sgim_im": (0.1, 0.07, 0.08, 0.036, 0.03)}),
        (0, {"asked": {"sgim-im": {"all": (140, 128, 60, 60, 50, 40)}}}),
        (1, {"taught_at_start": (0.1, 0.07, 0.04, 0.036, 0.029)}),
        (2, {"taught_at_start_once": (0.1, 0.07, 0.04, 0.036, 0.029)}),
        (3, {"sgim_im_83": (0.1, 0.07, 0.04, 0.036, 0.047)}),
        (3, {"asked": {"sgim-im-83": {"all": (140, 84, 60, 60, 50, 40)}}}),
        (4, {"sgim_acts_four": (0.1, 0.07, 0.04, 0.036, 0.033)}),
        (4, {"sgim_acts_2": (0.1, 0.07, 0.04, 0.036, 0.028)}),
        (5, {"asked": {"sgim-acts-four": dict.fromkeys(FOUR, (50, 40, 20, 0, 0, 0))}}),
        (6, {"asked": {"sgim-acts-halves": {"low-half": (50, 40, 20, 19, 0, 0), "high-half": (50, 40, 30, 20, 0, 0)}}}),
        (7, {"asked": {"sgim-im-cost-10": {"all": (140, 112, 60, 60, 50, 40)}}}),
        (8, {"sgim_im_cost_10": (0.2, 0.15, 0.07, 0.06, 0.052)}),
        (9, {"sgim_eer": (0.2, 0.15, 0.07, 0.06, 0.029)}),
        (10, {"sgim_eer_mixture": (0.2, 0.15, 0.039, 0.06, 0.046)}),
        (11, {"alone_toss_blind": (0.2, 0.15, 0.039, 0.06, 0.046)}),
        (12, {"alone_toss": (0.2, 0.15, 0.039, 0.06, 0.046)}),
        (13, {"asked": {"sgim-im-toss": {"all": (140, 110, 60, 60, 40, 50)}}}),
    ],
)
def test_a_bar_that_is_missed_does_not_hold(tmp_path, claim, spoilt):
    assert verdicts(write(tmp_path, **spoilt))[claim] == "does not hold"


def test_at_equal_cost_sgim_d_is_taken_between_its_evaluations(tmp_path):
    # 50 demonstrations at 10: 5500 in all, which SGIM-D has spent after 4125 movements, at .06 - .014 * 2125 / 3000.
    at_4125 = 0.06 - 0.014 * 2125 / 3000
    slightly = {"sgim_im_cost_10": (*GOOD[:4], 0.99 * at_4125)}
    assert verdicts(write(tmp_path, **slightly))[8] == "holds"
    assert 0.99 * at_4125 > WORSE[-1]  # though SGIM-D ends lower, at a higher cost
    assert verdicts(write(tmp_path, sgim_im_cost_10=(*GOOD[:4], 1.01 * at_4125)))[8] == "does not hold"


def test_what_was_not_run_is_left_open(tmp_path):
    missing = ("sgim-acts-four", "sgim-im-toss", *SINGLE)
    found = verdicts(write(tmp_path, without=missing))
    assert [claim for claim, verdict in enumerate(found) if verdict == "cannot say"] == [4, 5, 11, 12, 13]


def test_who_was_asked_and_the_errors_by_wind_are_means_over_seeds(tmp_path):
    folder = write(tmp_path)
    rows = teachers_rows(read_asking(folder))
    more = np.mean([seed % 3 for seed in range(SEEDS)])
    assert ["`sgim-acts-halves`", "high-half", f"{50 + more:.1f}", "40.0", "30.0", "28.0"] in rows
    assert ["`sgim-acts-four`", "mislabelling", f"{9 + more:.1f}", "8.0", "1.0", ""] in rows
    assert contexts_rows(folder) == [
        *(
            ["`alone-toss`", part, error]
            for part, error in (("-3 to -1", "0.0800"), ("-1 to 1", "0.0400"), ("1 to 3", "0.0800"))
        ),
        *(
            ["`sgim-im-toss`", part, error]
            for part, error in (("-3 to -1", "0.0600"), ("-1 to 1", "0.0400"), ("1 to 3", "0.0600"))
        ),
    ]


def pages(folder, *options):
    return command(main, ["--results", str(folder), "--out", str(folder / "pages"), *options])


def test_the_page_has_the_verdicts_and_its_tables(tmp_path, capsys):
    assert pages(write(tmp_path), "--only", "ASKING") == 0
    assert f"{len(ASKING_CLAIMS)} claims: {len(ASKING_CLAIMS)} holds" in capsys.readouterr().out
    page = (tmp_path / "pages/ASKING.md").read_text()
    assert all(claim.text in page for claim in ASKING_CLAIMS)
    assert all(f"| {name} |" in page for name in EXPERIMENTS["asking"])
    assert "Not run" not in page


def test_without_its_rows_the_page_cannot_be_made(tmp_path, capsys):
    assert pages(tmp_path, "--only", "ASKING") == 2
    assert "asking.csv does not exist" in capsys.readouterr().err
    assert not (tmp_path / "pages").exists()


@pytest.mark.parametrize(
    ("low", "message"), [("left", "low and high must be numbers"), ("0", "mean_error_m must be a")]
)
def test_a_damaged_table_of_contexts_is_refused(tmp_path, low, message):
    (tmp_path / "x.csv").write_text(f"{','.join(CONTEXTS_HEADER)}\nalone-toss,1,1000,own,{low},2,-1\n")
    with pytest.raises(ResultsError, match=message):
        read_contexts(tmp_path / "x.csv")
    assert read_contexts(tmp_path / "none.csv") == {} == read_asked(tmp_path / "none.csv")


def test_every_table_of_the_experiment_has_its_rows_made():
    evaluations, *others = tables_of("asking")
    assert evaluations == "asking.csv"
    assert {*others} <= ROWS.keys()


def run_in(contexts, parts):
    """A run with these contexts ``(n, dim)`` and errors by part of C."""
    names = ("movements", "answer", "context", "low", "high", "goals", "mean_error_m")
    nothing, columns = np.empty((0, 2)), dict(zip(names, map(np.array, zip(*parts, strict=True)), strict=True))
    order = np.arange(len(contexts))
    places = {"contexts": contexts, "thetas": nothing, "goals": nothing, "outcomes": nothing}
    return Run(None, {}, {}, {}, order, order, order, **places, answers={}, regions=None, by_context=columns)


def test_parts_of_c_without_goals_have_no_row():
    from sgimd_torch.runs.config import Config

    parts = [(20, "own", 0, -3.0, -1.0, 2, 0.5), (20, "own", 0, -1.0, 1.0, 0, np.nan)]
    config = Config(name="x", seed=7)
    assert context_rows(config, run_in(np.zeros((3, 1)), parts)) == [["x", 7, 20, "own", -3.0, -1.0, 0.5]]
    assert context_rows(config, run_in(np.zeros((3, 2)), parts)) == []
