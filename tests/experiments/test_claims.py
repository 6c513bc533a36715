"""The claims, each on made-up rows in which it is true, and on rows that are spoilt for it; how bars are judged."""

import pytest

from asking_claims import ASKING_CLAIMS, SINGLE
from judging import Claim, Results, at_least, at_most, judge
from learning_claims import LEARNING_CLAIMS, SUITE_CLAIMS, TAUGHT_RIVALS
from made_up import (
    ASKING,
    FOUR,
    PAPER,
    SEEDS,
    TASKS,
    row,
    write,
    write_asking,
    write_goals,
    write_learning,
    write_model,
    write_paper,
)
from paper_claims import BARS, JUDGED, MODEL_CLAIMS, PAPER_CLAIMS, _less
from sgimd_torch.views.statistics import Interval
from table import read_table
from variants import EXPERIMENTS
from variants import PAPER as EXPERIMENTS_OF_THE_PAPER

# What is claimed, what writes rows in which all is true, of which experiments and small tables, and who answers.
CLAIMS = {
    "paper": (PAPER_CLAIMS, write_paper, (*EXPERIMENTS_OF_THE_PAPER,), ["goals.csv"], "linear"),
    "model": (MODEL_CLAIMS, write_model, ("forward-model", "planar-arm-50"), [], "linear"),
    "learning": (LEARNING_CLAIMS, write_learning, ("learning", "suite"), [], "process"),
    "suite": (SUITE_CLAIMS, write_learning, ("learning", "suite"), [], "process"),
    "asking": (ASKING_CLAIMS, write_asking, ("asking",), ["asked.csv"], "process"),
}


def judged(page, folder):
    claims, _, experiments, small, answer = CLAIMS[page]
    return judge(claims, Results.of(folder, experiments, small), answer)


def verdicts(page, folder, **spoilt):
    """In the order of the claims, on rows with these changes."""
    CLAIMS[page][1](folder, **spoilt)
    return [found.verdict for found in judged(page, folder)]


@pytest.mark.parametrize("page", CLAIMS)
def test_where_every_bar_is_cleared_every_claim_holds(tmp_path, page):
    assert verdicts(page, tmp_path) == ["holds"] * len(CLAIMS[page][0])


def changed(place, factor):
    """Rows of the suite by (variant, movements, answer): those of ``place`` (None: any) are so much worse."""

    def change(*found):
        return factor if all(want is None or have.startswith(want) if isinstance(have, str) else want in (None, have)
                             for have, want in zip(found, place, strict=True)) else 1.0  # fmt: skip

    return {"suite": change, "linear": 1.0}


def asked(variant, **teachers):
    return {"asked": {variant: {name.replace("_", "-"): counts for name, counts in teachers.items()}}}


SPOILT = {  # the number of a claim: changes each of which makes it wrong
    "paper": {
        0: [{"sgim_d": {"last": 0.13}}],
        1: [{"sagg_riac": {"last": 0.25}}],
        2: [{"imitation": {"last": 0.25}}],
        3: [{"observation": {"last": 0.05}}],
        4: [{"random": {"last": 0.07}}],
        6: [{"random": {"last": 0.081}}],
        7: [{"sgim_d_teacher_1": {"last": 0.155}}],
        8: [{"imitation_teacher_2": {"last": 0.07}}],
        9: [{"sagg_riac": {"last": 0.07}}],
        10: [{"sgim_d_large": {"last": 0.11}}],
        11: [{"sagg_riac_large": {"last": 0.15}}],
        13: [{"sagg_riac": {"tiles": 50}}],
        15: [{"uniform_goals": {"last": 0.07}}],
        16: [{"sgim_d_uniform_large": {"last": 0.07}}],
        17: [{"random_goals_demonstrations": {"last": 0.07}}],
        18: [{"random_goals_demonstrations_large": {"last": 0.08}}],
        19: [{"cma_mae": {"last": 0.07}}],
        20: [{"cma_mae_demonstrations": {"last": 0.07}}],
        21: [{"cma_mae_demonstrations_tuned": {"last": 0.07}}],
        22: [{"sgim_d_letter": {"last": 0.07}}],
        23: [{"sgim_d_absolute_large": {"last": 0.3}}],
    },
    "model": {
        0: [{"model": {2000: 0.07, 3000: 0.06}}, {"model": {1000: 0.09, 2000: 0.08, 3000: 0.07, 5000: 0.06}}],
        2: [{"model": dict.fromkeys(worse, 0.09)} for worse in ((1000, 2000), (1000, 5000), (2000, 5000))],
        4: [{"model": {5000: 0.036}}],
        6: [{"model_arm_50": {2000: 0.016}}],
    },
    "learning": {
        0: [{"practice_taught": (0.11, 0.06, 0.04, 0.036, 0.03)}],
        1: [{"practice_taught": (0.09, 0.06, 0.04, 0.036, 0.034)}],
        2: [{"floor": 0.028}],
        3: [{"practice_taught": (0.09, 0.06, 0.04, 0.036, 0.039)}],
        4: [{"cma_mae": (0.3, 0.2, 0.1, 0.08, 0.034)}],
        5: [{TAUGHT_RIVALS[1].removesuffix(".rod"): (0.09, 0.05, 0.05, 0.04, 0.04)}],
        6: [{"sgim_d": (0.2, 0.1, 0.035, 0.05, 0.045)}],
        7: [{"sgim_d_uniform": (0.2, 0.1, 0.08, 0.06, 0.04)}],
        8: [{"practice_corner": (0.11, 0.06, 0.04, 0.036, 0.03)}],
        9: [{"practice_shuffled": (0.09, 0.06, 0.04, 0.036, 0.04)}],
        10: [{"practice_shuffled": (0.11, 0.06, 0.04, 0.036, 0.03)}],
        11: [{"by_model": 1.1}],
        12: [{"uniform_nearest_taught": (0.2, 0.1, 0.08, 0.06, 0.04)}],
    },
    "suite": {
        0: [changed(("practice.toss", 500, "process"), 2.2)],
        1: [changed(("practice.swimmer", 250, "process"), 1.7)],
        2: [changed(("uniform", 1000, None), 0.8)],
        3: [changed(("uniform", 1000, "process"), 0.8)],
        4: [changed(("map-elites", 2000, None), 0.6)],
        5: [changed(("practice.crawler", 2000, None), 5)],
        6: [changed(("cma-mae.spatial-arm", None, "nearest"), 0.9)],
        7: [changed(("map-elites.rod", None, "linear"), 0.9)],
    },
    "asking": {
        0: [{"sgim_im": (0.1, 0.07, 0.08, 0.036, 0.03)}, asked("sgim-im", all=(140, 128, 60, 60, 50, 40))],
        1: [{"taught_at_start": (0.1, 0.07, 0.04, 0.036, 0.029)}],
        2: [{"taught_at_start_once": (0.1, 0.07, 0.04, 0.036, 0.029)}],
        3: [{"sgim_im_83": (0.1, 0.07, 0.04, 0.036, 0.047)}, asked("sgim-im-83", all=(140, 84, 60, 60, 50, 40))],
        4: [{"sgim_acts_four": (*[0.1] * 4, 0.033)}, {"sgim_acts_2": (*[0.1] * 4, 0.028)}],
        5: [{"asked": {"sgim-acts-four": dict.fromkeys(FOUR, (50, 40, 20, 0, 0, 0))}}],
        6: [asked("sgim-acts-halves", low_half=(50, 40, 20, 19, 0, 0), high_half=(50, 40, 30, 20, 0, 0))],
        7: [asked("sgim-im-cost-10", all=(140, 112, 60, 60, 50, 40))],
        8: [{"sgim_im_cost_10": (0.2, 0.15, 0.07, 0.06, 0.052)}],
        9: [{"sgim_eer": (0.2, 0.15, 0.07, 0.06, 0.029)}],
        10: [{"alone_toss_blind": (0.2, 0.15, 0.039, 0.06, 0.046)}],
        11: [{"alone_toss": (0.2, 0.15, 0.039, 0.06, 0.046)}],
        12: [asked("sgim-im-toss", all=(140, 110, 60, 60, 40, 50))],
    },
}
ELSEWHERE = {"paper": {5, 12, 14}, "model": {*range(1, 8, 2)}}  # tested below; those of another model


@pytest.mark.parametrize(
    ("page", "claim", "spoilt"),
    [(page, claim, each) for page, found in SPOILT.items() for claim, several in found.items() for each in several],
)
def test_a_claim_that_the_rows_contradict_does_not_hold(tmp_path, page, claim, spoilt):
    assert verdicts(page, tmp_path, **spoilt)[claim] == "does not hold"


@pytest.mark.parametrize("page", CLAIMS)
def test_every_claim_is_spoilt_once(page):
    assert {*SPOILT[page]} | ELSEWHERE.get(page, set()) == {*range(len(CLAIMS[page][0]))}


def edited(folder, which, **values):
    """The table with other values in the rows of which ``which(table)`` is true."""
    table = read_table(folder)
    for column, value in values.items():
        table.loc[which(table), column] = value
    return write(folder, table.to_dict("records"))


def test_an_error_far_above_the_noise_floor_does_not_approach_it(tmp_path):
    write_paper(tmp_path)
    edited(
        tmp_path, lambda table: (table.variant == "sgim-d") & (table.movements == 5000) & (table.own == 1), floor=0.04
    )
    assert judged("paper", tmp_path)[5].verdict == "does not hold"


def test_an_error_that_rises_again_is_late_damage(tmp_path):
    write_paper(tmp_path)
    edited(tmp_path, lambda table: (table.variant == "sgim-d-long") & (table.movements == 10_000), error=0.1)
    assert judged("paper", tmp_path)[14].verdict == "does not hold"


@pytest.mark.parametrize(
    ("sgim_d", "sagg_riac", "verdict"),
    [
        ((40, 50, 60, 50, 50), (0, 0, 0, 0, 0), "holds"),
        ((40, 50, 60, 50, 50), (30, 30, 30, 30, 30), "does not hold"),
        ((0, 0, 60, 0, 60), (0, 1, 1, 0, 1), "cannot say"),
        ((40, 50, 60, 50), (0, 0, 0, 0), "cannot say"),  # too few seeds
    ],
)
def test_goals_count_as_near_by_their_share(tmp_path, sgim_d, sagg_riac, verdict):
    write_paper(tmp_path)
    write_goals(tmp_path, sgim_d, sagg_riac)
    assert judged("paper", tmp_path)[12].verdict == verdict


def test_learners_are_compared_by_the_same_inverse_whatever_their_own(tmp_path):
    """The baseline's own answers are poor, those of ``LocallyLinear`` from the same memory are better than SGIM-D's."""
    write_paper(tmp_path)
    assert judged("paper", tmp_path)[17].verdict == "holds"
    edited(
        tmp_path,
        lambda table: (table.variant == "random-goals-demonstrations") & (table.answer == "linear"),
        error=0.05,
    )
    assert judged("paper", tmp_path)[17].verdict == "does not hold"


def test_at_equal_cost_sgim_d_is_taken_between_its_evaluations(tmp_path):
    # 50 demonstrations at 10: 5500 in all, which SGIM-D has spent after 4125 movements, at .06 - .014 * 2125 / 3000.
    at_4125, early = 0.06 - 0.014 * 2125 / 3000, ASKING["sgim-im"][:4]
    assert verdicts("asking", tmp_path, sgim_im_cost_10=(*early, 0.99 * at_4125))[8] == "holds"
    assert 0.99 * at_4125 > ASKING["taught-every-30"][-1]  # though SGIM-D ends lower, at a higher cost
    assert verdicts("asking", tmp_path, sgim_im_cost_10=(*early, 1.01 * at_4125))[8] == "does not hold"


def test_what_was_not_run_is_left_open(tmp_path):
    def open_ones(page, **missing):
        return {claim for claim, verdict in enumerate(verdicts(page, tmp_path, **missing)) if verdict == "cannot say"}

    assert open_ones("asking", without=("sgim-acts-four", "sgim-im-toss", *SINGLE)) == {4, 5, 10, 11, 12}
    assert open_ones("model", without=("gradient", "model-arm-50")) == {1, 3, 5, 6}
    assert len(open_ones("suite", tasks=[name for name in TASKS if name != "crawler"])) == len(SUITE_CLAIMS)
    assert len(BARS) * len(JUDGED) == len(MODEL_CLAIMS) == 8


UNJUDGED = {"grid", "observation-teacher-1", "observation-teacher-2", "sagg-riac-absolute-large"}


@pytest.mark.parametrize("missing", ["random", "sgim-d", "imitation-teacher-1", "sgim-d-long", "cma-mae"])
def test_what_was_not_run_is_named_and_the_other_claims_are_judged(tmp_path, missing):
    found = judged("paper", write_paper(tmp_path, without=[missing]))
    open_ones = [each for each in found if each.verdict != "holds"]
    assert {(each.number, each.verdict) for each in open_ones} == {(f"not run: {missing}", "cannot say")}
    assert len(open_ones) < len(found) or missing == "sgim-d"


def test_every_variant_of_the_made_up_rows_is_judged(tmp_path):
    assert UNJUDGED < {*PAPER} <= {name for each in EXPERIMENTS_OF_THE_PAPER for name in EXPERIMENTS[each]}


def test_a_claim_among_many_needs_more_certainty_than_one_alone(tmp_path):
    """Five seeds decide a claim alone; among all of the page, by Holm's method, they do not."""
    errors = {"ours": [0.1] * 5, "theirs": [0.105, 0.12, 0.0995, 0.11, 0.103]}
    rows = [
        row("learners", name, seed, 5000, "linear", error)
        for name, found in errors.items()
        for seed, error in enumerate(found)
    ]
    results = Results.of(write(tmp_path, rows), ["learners"])
    claim = _less("ours err less", "ours", "theirs")
    others = [Claim(f"not run {k}", "", _less("", "ours", f"missing {k}").judged) for k in range(20)]
    (alone,), (among, *_) = (judge(claims, results, "linear") for claims in ([claim], [claim, *others]))
    assert (alone.verdict, alone.alone) == ("holds", "holds")
    assert (among.verdict, among.alone) == ("cannot say", "holds")
    assert among.number == alone.number
    assert among.effect.startswith("ours − theirs: −0.00")


def test_when_the_interval_straddles_the_bar_nothing_can_be_said(tmp_path):
    found = verdicts("paper", tmp_path, sagg_riac={"last": [0.02, 0.3, 0.2, 0.12, 0.25] * (SEEDS // 5)})
    assert (found[1], found[0]) == ("cannot say", "holds")


@pytest.mark.parametrize(
    ("value", "low", "high", "verdict"),
    [
        (0.48, 0.46, 0.54, "holds"),
        (0.48, 0.46, 0.56, "cannot say"),
        (0.52, 0.49, 0.54, "cannot say"),
        (0.52, 0.51, 0.54, "does not hold"),
    ],
)
def test_a_bar_with_a_margin_for_its_interval(value, low, high, verdict):
    assert at_most(Interval(value, low, high), 0.5, upper=0.55) == verdict
    assert at_least(Interval(-value, -high, -low), -0.5, lower=-0.55) == verdict


def test_a_run_that_is_under_way_is_counted_where_it_was_evaluated(tmp_path):
    write_paper(tmp_path)
    table = read_table(tmp_path)
    stopped = (table.variant == "sgim-d") & (table.seed == 0) & (table.movements == 5000)
    results = Results.of(write(tmp_path, table[~stopped].to_dict("records")), ["learners"]).by("linear")
    assert {*results.at("sgim-d")} == {*range(1, SEEDS)}
    assert {*results.at("sgim-d", 1000)} == {*range(SEEDS)}
    assert results.curves("sgim-d")[1].shape == (SEEDS - 1, 7)
