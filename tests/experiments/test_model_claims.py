"""The bars of the forward model, and the tables that stand in results/FORWARD_MODEL.md."""

import numpy as np
import pytest

from claims import main
from judging import Results, judge
from model_claims import BARS, JUDGED, MODEL_CLAIMS
from paper import HEADER, SEEDS, spread
from read_results import MODEL_HEADER, REGIONS, ResultsError, read_coverages, read_results
from sgimd_torch.runs.process import command

TRUE = {  # variant: experiment, its errors (m) by movements
    "sgim-d": ("forward-model", {500: 0.1, 1000: 0.08, 2000: 0.06, 3000: 0.05, 5000: 0.045}),
    **{name: ("forward-model", {500: 0.1, 1000: 0.06, 2000: 0.04, 3000: 0.035, 5000: 0.03}) for name in JUDGED},
    "sagg-riac": ("forward-model", {500: 0.2, 1000: 0.15, 2000: 0.1, 3000: 0.09, 5000: 0.08}),
    "sagg-riac-model": ("forward-model", {500: 0.2, 1000: 0.14, 2000: 0.09, 3000: 0.08, 5000: 0.07}),
    "sgim-d-arm-50": ("planar-arm-50", {250: 0.2, 500: 0.1, 1000: 0.05, 2000: 0.03}),
    **{f"{name}-arm-50": ("planar-arm-50", {250: 0.2, 500: 0.1, 1000: 0.03, 2000: 0.01}) for name in JUDGED},
}
FLOOR = 0.033  # m
HONEST = {name: {region: np.full(5, region / 100) for region in REGIONS} for name in JUDGED}
CLAIMS = [claim for claim, _, _ in BARS]


def write(path, *, without=(), **spoilt):
    """``spoilt``: variant, with _ for -, to errors that replace the true ones."""
    lines = []
    for name, (experiment, errors) in TRUE.items():
        for seed in range(SEEDS) if name not in without else ():
            for movements, error in {**errors, **spoilt.get(name.replace("-", "_"), {})}.items():
                floor = FLOOR if movements == 5000 else ""
                lines.append(f"{experiment},{name},3,1,{seed},{movements},own,{error * spread(seed)},{floor},300,,")
    path.write_text("\n".join([HEADER, *lines]) + "\n")
    return path


def verdicts(path, coverages=HONEST):
    rows = judge(MODEL_CLAIMS, Results(read_results(path), coverages=coverages))
    return {row.claim: row.verdict for row in rows}


def test_where_every_bar_is_cleared_every_one_holds(tmp_path):
    found = verdicts(write(tmp_path / "x.csv"))
    assert len(found) == len(JUDGED) * len(BARS)
    assert set(found.values()) == {"holds"}


@pytest.mark.parametrize(
    ("claim", "errors"),
    [
        (CLAIMS[0], {2000: 0.07, 3000: 0.06}),  # comes down to .045 at 4000
        (CLAIMS[1], {1000: 0.09, 2000: 0.07}),  # better at 5000 only
        (CLAIMS[2], {5000: 0.036}),
    ],
)
def test_a_bar_that_is_missed_does_not_hold_and_the_others_of_that_model_may(tmp_path, claim, errors):
    found = verdicts(write(tmp_path / "x.csv", model=errors))
    assert found[f"{claim}: `model`"] == "does not hold"
    assert found[f"{claim}: `gradient`"] == "holds"


@pytest.mark.parametrize("worse", [(1000, 2000), (1000, 5000), (2000, 5000)])
def test_lower_at_one_of_three_is_not_lower(tmp_path, worse):
    found = verdicts(write(tmp_path / "x.csv", model=dict.fromkeys(worse, 0.09)))
    assert found[f"{CLAIMS[1]}: `model`"] == "does not hold"


def test_half_of_the_error_on_fifty_joints_is_half(tmp_path):
    found = verdicts(write(tmp_path / "x.csv", model_arm_50={2000: 0.016}))
    assert found[f"{CLAIMS[3]}: `model`"] == "does not hold"


def test_a_level_that_is_never_reached_does_not_count_as_early(tmp_path):
    worse = {1000: 0.09, 2000: 0.08, 3000: 0.07, 5000: 0.06}
    assert verdicts(write(tmp_path / "x.csv", model=worse))[f"{CLAIMS[0]}: `model`"] == "does not hold"


def test_what_was_not_run_is_left_open(tmp_path):
    found = verdicts(write(tmp_path / "x.csv", without=("gradient", "model-arm-50")), {})
    open_ones = {claim for claim, verdict in found.items() if verdict == "cannot say"}
    wanted = {f"{claim}: `gradient`" for claim in CLAIMS[:3]} | {f"{CLAIMS[3]}: `model`"}
    assert open_ones == wanted | {f"calibration, {region} %: `{name}`" for name in JUDGED for region in REGIONS}


@pytest.mark.parametrize(
    ("region", "share", "verdict"),
    [
        *((50, 0.35, "does not hold"), (50, 0.45, "holds"), (50, 0.62, "does not hold")),
        *((80, 0.65, "does not hold"), (80, 0.75, "holds"), (80, 0.93, "does not hold")),
        *((95, 0.9, "does not hold"), (95, 0.92, "holds"), (95, 1.0, "does not hold")),
    ],
)
def test_a_spread_may_be_neither_overconfident_nor_too_cautious(tmp_path, region, share, verdict):
    spoilt = {**HONEST["model"], region: np.full(5, share)}
    found = verdicts(write(tmp_path / "x.csv"), {**HONEST, "model": spoilt})
    for each in REGIONS:
        assert found[f"calibration, {each} %: `model`"] == (verdict if each == region else "holds")


def write_table(path, *lines):
    """The table of model_figures.py: of each run its name and the share in its regions, whatever they should hold."""
    rows = [{"run": run, **{f"inside_{region}_late": share for region in REGIONS}} for run, share in lines]
    text = [",".join(MODEL_HEADER), *(",".join(str(row.get(name, 1)) for name in MODEL_HEADER) for row in rows)]
    path.write_text("\n".join(text) + "\n")


def make_page(tmp_path):
    """The exit code of making FORWARD_MODEL.md from the rows there."""
    options = ["--results", tmp_path, "--table", tmp_path / "table.csv", "--out", tmp_path, "--only", "FORWARD_MODEL"]
    return command(main, list(map(str, options)))


def test_the_page_has_its_prose_and_gets_its_tables(tmp_path, capsys):
    write(tmp_path / "forward_model.csv")
    shares = [(f"model/seed-{seed:03d}", share) for seed, share in enumerate((0.8, 0.82, 0.81, 0.81, 0.81))]
    write_table(tmp_path / "table.csv", *shares, ("gradient/seed-000", "nan"))
    assert make_page(tmp_path) == 0
    text = (tmp_path / "FORWARD_MODEL.md").read_text()
    assert "\n# The forward model\n" in text
    assert "0.81 [0.80, 0.82], single runs 0.80 to 0.82" in text
    (line,) = (line for line in text.splitlines() if line.startswith("| sagg-riac-model |"))
    assert "−0.01" in line  # compared with sagg-riac, not with SGIM-D
    assert "9 holds, 2 does not hold, 3 cannot say" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda text: "variant,x\nmodel,1\n", "table.csv must begin with run,predicted"),
        (lambda text: text.replace("0.8,", "much,"), "table.csv, line 2: inside_50_late must be a finite number"),
    ],
)
def test_a_table_of_something_else_is_refused_and_the_page_untouched(tmp_path, capsys, spoil, message):
    table = tmp_path / "table.csv"
    write_table(table, ("model/seed-000", 0.8))
    table.write_text(spoil(table.read_text()))
    with pytest.raises(ResultsError, match=message):
        read_coverages(table)
    write(tmp_path / "forward_model.csv")
    assert make_page(tmp_path) == 2
    assert f"error: {tmp_path}" in capsys.readouterr().err
    assert not (tmp_path / "FORWARD_MODEL.md").exists()
