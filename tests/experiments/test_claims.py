"""The verdicts on the paper's claims, the tables that stand in results/RESULTS.md, and how pages are made."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from claims import OPTIONAL, PAGES, main
from judging import Claim, Results, at_least, at_most, errs_less, judge
from paper import SEEDS, TRUE, error, rows, spread, write_paper
from paper_claims import PAPER_CLAIMS
from quoted import TEMPLATES, Quoted
from read_results import Evaluated, ResultsError, Values, read_goals, read_results
from sgimd_torch.runs.process import command
from sgimd_torch.views.statistics import Interval

NAMES = [claim.text for claim in PAPER_CLAIMS]
SHIPPED = Path(__file__).parents[2] / "results"
SHIPPED_PAGES = [name for name in PAGES if (SHIPPED / f"{name}.md").exists()]


def write_goals(path, sgim_d=(40, 60, 50, 45, 55), sagg_riac=(1, 0, 2, 1, 1)):
    lines = [f"sgim-d-large,{seed},400,{near}" for seed, near in enumerate(sgim_d)]
    lines += [f"sagg-riac-large,{seed},500,{near}" for seed, near in enumerate(sagg_riac)]
    path.write_text("\n".join(["variant,seed,n_goals,n_near", *lines]) + "\n")
    return path


@pytest.fixture
def results(tmp_path):
    write_goals(tmp_path / "goals.csv")
    return write_paper(tmp_path / "paper.csv")


def judged(results):
    goals = read_goals(results.with_name("goals.csv"))
    return judge(PAPER_CLAIMS, Results(read_results(results), goals, same=read_results(results, "linear")))


def make_page(results, out):
    """The exit code of making RESULTS.md."""
    return command(main, ["--results", str(results.parent), "--out", str(out), "--only", "RESULTS"])


def verdicts(results):
    return {row.claim: row.verdict for row in judged(results)}


def test_where_the_paper_is_right_every_claim_holds(results):
    assert set(verdicts(results).values()) == {"holds"}


SPOILT = {  # claim: a change that makes it wrong
    NAMES[0]: {"sgim_d": {"last": 0.13}},
    NAMES[1]: {"sagg_riac": {"last": 0.25}},
    NAMES[2]: {"imitation": {"last": 0.25}},
    NAMES[3]: {"observation": {"last": 0.05}},
    NAMES[4]: {"random": {"last": 0.07}},
    NAMES[6]: {"random": {"last": 0.081}},
    NAMES[7]: {"sgim_d_teacher_1": {"last": 0.155}},
    NAMES[8]: {"imitation_teacher_2": {"last": 0.07}},
    NAMES[9]: {"sagg_riac": {"last": 0.07}},
    NAMES[10]: {"sgim_d_large": {"last": 0.11}},
    NAMES[11]: {"sagg_riac_large": {"last": 0.15}},
    NAMES[13]: {"sagg_riac": {"tiles": 50}},
    NAMES[15]: {"uniform_goals": {"last": 0.07}},
    NAMES[16]: {"sgim_d_uniform_large": {"last": 0.07}},
    NAMES[17]: {"random_goals_demonstrations": {"last": 0.07}},
    NAMES[18]: {"random_goals_demonstrations_large": {"last": 0.08}},
    NAMES[19]: {"cma_mae": {"last": 0.07}},
    NAMES[20]: {"cma_mae_demonstrations": {"last": 0.07}},
    NAMES[21]: {"cma_mae_demonstrations_tuned": {"last": 0.07}},
    NAMES[22]: {"sgim_d_letter": {"last": 0.07}},
    NAMES[23]: {"sgim_d_absolute_large": {"last": 0.3}},
}


@pytest.mark.parametrize("claim", SPOILT)
def test_a_claim_that_the_runs_contradict_does_not_hold(results, claim):
    write_paper(results, **SPOILT[claim])
    assert verdicts(results)[claim] == "does not hold"


def test_an_error_far_above_the_noise_floor_does_not_approach_it(results):
    text = results.read_text()
    results.write_text(re.sub(r"(sgim-d,3,1,\d+,5000,\w+,[\d.]+),[\d.]+", r"\1,0.04", text))
    assert verdicts(results)["SGIM-D approaches the noise level"] == "does not hold"


def test_an_error_that_rises_again_is_late_damage(results):
    text = results.read_text()
    results.write_text(re.sub(r"(sgim-d-long,3,1,\d+,10000,\w+),[\d.]+", r"\1,0.1", text))
    assert verdicts(results)["No late damage"] == "does not hold"


@pytest.mark.parametrize(
    ("sgim_d", "sagg_riac", "verdict"),
    [
        ((40, 50, 60, 50, 50), (0, 0, 0, 0, 0), "holds"),
        ((40, 50, 60, 50, 50), (30, 30, 30, 30, 30), "does not hold"),
        ((0, 0, 60, 0, 60), (0, 1, 1, 0, 1), None),
        ((40, 50, 60, 50), (0, 0, 0, 0), None),  # too few seeds
    ],
)
def test_goals_count_as_near_by_their_share(results, sgim_d, sagg_riac, verdict):
    write_goals(results.with_name("goals.csv"), sgim_d, sagg_riac)
    assert verdicts(results)[NAMES[12]] == (verdict or "cannot say")


def test_learners_are_compared_by_the_same_inverse_whatever_their_own(results):
    """The baseline's own answers are poor, those of ``LocallyLinear`` from the same memory are better than SGIM-D's."""
    claim = "SGIM-D beats the field's standard baseline"
    lines = results.read_text().splitlines()
    ours = [k for k, line in enumerate(lines) if ",random-goals-demonstrations," in line and ",linear," in line]
    for k in ours:
        fields = lines[k].split(",")
        fields[7] = str(float(fields[7]) / 2)
        lines[k] = ",".join(fields)
    assert verdicts(results)[claim] == "holds"
    results.write_text("\n".join(lines) + "\n")
    assert verdicts(results)[claim] == "does not hold"


def test_a_claim_among_many_needs_more_certainty_than_one_alone(results):
    """Five seeds decide a claim alone; among all of the page, by Holm's method, they do not."""
    ours, theirs = dict.fromkeys(range(5), 0.1), {0: 0.105, 1: 0.12, 2: 0.0995, 3: 0.11, 4: 0.103}
    made = {
        name: Evaluated(name, "learners", {(seed, 5000): Values(each[seed], *[math.nan] * 4) for seed in each})
        for name, each in (("ours", ours), ("theirs", theirs))
    }
    claim = Claim("ours err less", "difference < 0", errs_less("ours", "theirs"), [("ours", "theirs")])
    others = [Claim(f"not run {k}", "", errs_less("ours", f"missing {k}")) for k in range(20)]
    (alone,) = judge([claim], Results({}, same=made))
    among, *_ = judge([claim, *others], Results({}, same=made))
    assert (alone.verdict, alone.alone) == ("holds", "holds")
    assert (among.verdict, among.alone) == ("cannot say", "holds")
    assert among.number == alone.number
    assert among.effect.startswith("ours − theirs: −0.00")


def test_when_the_interval_straddles_the_bar_nothing_can_be_said(results):
    noisy = [0.02, 0.3, 0.2, 0.12, 0.25]
    write_paper(results, sagg_riac={"last": noisy * (SEEDS // 5)})
    found = verdicts(results)
    assert found["SAGG-RIAC clearly beats Random"] == "cannot say"
    assert found["SGIM-D halves Random's error"] == "holds"


UNJUDGED = {"grid", "observation-teacher-1", "observation-teacher-2", "sagg-riac-absolute-large"}


@pytest.mark.parametrize("missing", sorted(set(TRUE) - UNJUDGED))
def test_what_was_not_run_is_named_and_the_other_claims_are_judged(tmp_path, missing):
    write_goals(tmp_path / "goals.csv")
    found = judged(write_paper(tmp_path / "paper.csv", without=[missing]))
    open_ = [row for row in found if row.verdict != "holds"]
    assert open_
    assert {(row.number, row.verdict) for row in open_} == {(f"not run: {missing}", "cannot say")}
    assert len(open_) < len(found) or missing == "sgim-d"


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


def test_at_least_is_at_most_turned_round():
    assert at_least(Interval(0.97, 0.95, 1.0), 0.95) == "holds"
    assert at_least(Interval(0.97, 0.90, 1.0), 0.95) == "cannot say"
    assert at_least(Interval(0.97, 0.90, 1.0), 0.95, lower=0.75) == "holds"
    assert at_least(Interval(0.94, 0.90, 1.0), 0.95, lower=0.75) == "cannot say"
    assert at_least(Interval(0.80, 0.70, 0.94), 0.95) == "does not hold"


def cells(text, variant):
    line = next(line for line in text.splitlines() if f"| {variant} |" in line)
    return [cell.strip() for cell in line.strip("|").split("|")]


def section(text, title):
    """What stands below a title of the page."""
    return re.search(rf"^##+ {title}$(.*?)(?=^##|\Z)", text, re.S | re.M)[1]


def test_the_tables_give_each_variant_beside_sgim_d(results, tmp_path):
    out = tmp_path / "new"
    assert make_page(results, out) == 0
    text = (out / "RESULTS.md").read_text()
    experiment, _, seeds, early, late, own, proved, _, better, difference, *counts = cells(text, "uniform-goals")
    assert (experiment, seeds) == ("ablations", str(SEEDS))
    middle = range(SEEDS // 4, SEEDS - SEEDS // 4)
    assert late == own
    assert proved.startswith(f"{0.9 * 0.085 * np.mean([spread(seed) for seed in middle]):.3f} [")
    assert late.startswith(f"{0.085 * np.mean([spread(seed) for seed in middle]):.3f} [")
    assert early.startswith(f"{np.mean([error(0.085, seed, 1000) for seed in middle]):.3f} [")
    assert better == "1.00 [0.90, 1.00]"
    assert difference.startswith("+0.0050 [+0.00")
    assert [count.partition(" ")[0] for count in counts] == ["300", "300", "150"]  # tiles reached, goals claimed, met
    assert cells(section(text, "The five learners"), "sgim-d")[8:10] == ["", ""]
    learners = section(text, "The five learners")
    order = re.findall(r"\| learners \| ([\w-]+)", learners)
    assert order == ["observation", "random", "sagg-riac", "imitation", "sgim-d"]  # the best last
    assert "uniform-goals" not in learners
    assert "| uniform-goals |" in section(text, "Ablations, rivals and other teaching")
    assert [
        line.split(" | ")[0][2:] for line in section(text, "The paper's claims").splitlines()[4 : 4 + len(NAMES)]
    ] == NAMES


def prose(text):
    return [line for line in text.splitlines() if not line.startswith("|")]


def test_the_same_results_give_the_same_file_and_the_prose_follows_other_ones(results, tmp_path):
    page = tmp_path / "RESULTS.md"
    assert make_page(results, tmp_path) == 0
    first = page.read_text()
    assert make_page(results, tmp_path) == 0
    assert page.read_text() == first
    write_paper(results, sgim_d={"last": 0.13})
    assert make_page(results, tmp_path) == 0
    said, before = prose(page.read_text()), prose(first)
    assert len(said) == len(before)
    changed = [(now, then) for now, then in zip(said, before, strict=True) if now != then]
    assert "SGIM-D to 0.130" in "".join(now for now, _ in changed)
    assert "SGIM-D to 0.080" in "".join(then for _, then in changed)
    assert len(changed) < len(before) / 4


def test_the_shipped_pages_are_what_the_shipped_rows_and_templates_make(tmp_path, capsys):
    """Change a template or the rows in results/, then run experiments/claims.py --readme README.md."""
    shipped_readme = (SHIPPED.parent / "README.md").read_text(encoding="utf-8")
    readme = tmp_path / "README.md"
    readme.write_text(re.sub(r"\b0\.\d\d\d\b", "9.999", shipped_readme), encoding="utf-8")
    assert readme.read_text(encoding="utf-8") != shipped_readme
    assert command(main, ["--results", str(SHIPPED), "--out", str(tmp_path), "--readme", str(readme)]) == 0
    assert readme.read_text(encoding="utf-8") == shipped_readme
    said = capsys.readouterr()
    for name in {*PAGES} - {*SHIPPED_PAGES}:
        assert f"{name} is left out: there is no {SHIPPED / OPTIONAL[name]} yet" in said.err
        assert not any((folder / f"{name}.md").exists() for folder in (tmp_path, SHIPPED))
    for name in SHIPPED_PAGES:
        made, shipped = ((folder / f"{name}.md").read_text(encoding="utf-8") for folder in (tmp_path, SHIPPED))
        assert made == shipped
        assert f"experiments/pages/{name}.md.j2" in made.splitlines()[0]
    assert f"{len(PAPER_CLAIMS)} claims:" in said.out


@pytest.mark.parametrize("name", [*PAGES, "README"])
def test_no_figure_is_written_by_hand_into_the_text_of_a_template(name):
    """Except in what no rows are kept of: the record of tuning, and the costs that a script measures."""
    text = (TEMPLATES / f"{name}.md.j2").read_text(encoding="utf-8").partition("## The record")[0]
    text = re.sub(r"\*\*What it costs\*\*.*?(?=\*\*The error)", "", text, flags=re.DOTALL)
    text = re.sub(r"\{\{.*?\}\}|`[^`]*`|\]\([^)]*\)|eqs?\. \([^)]*\)", "", text)
    lines = [line for line in text.splitlines() if not line.startswith("|")]
    assert len(lines) > 5
    by_hand = [found for line in lines for found in re.findall(r"\d*\.\d+|\d+ mm|\d+ %", line)]
    assert set(by_hand) <= {"95 %", "50 %", "80 %"}  # confidence, and what regions should hold


def test_a_figure_in_prose_is_that_of_the_rows(results):
    made = Quoted(Results(read_results(results), same=read_results(results, "linear")))
    assert made.error("sgim-d") == f"{0.08 * np.mean([spread(seed) for seed in range(5, 15)]):.3f}"
    assert made.interval("sgim-d", values="tiles", form=".0f").startswith("310 [3")
    assert made.less("sgim-d", "random").startswith("0.120 [0.1")
    assert made.less("random", "sgim-d").startswith("−0.120 [−0.1")
    assert made.ratio("sgim-d", "random") == "0.40"
    assert made.percent_more("random", "sgim-d").startswith("150 % [1")
    assert made.floor("sgim-d") == "0.072"
    assert made.times_the_floor("sgim-d", "sgim-d").startswith("1.11 [1.1")
    assert made.worse_in("sgim-d", "random") == "0 of 20"
    assert (made.seeds("random"), made.common("random", "sgim-d")) == ("20", "20")
    assert made.error("grid", 10_000) == made.less("grid", "nothing") == "(not run)"


def test_a_readme_without_a_section_of_results_is_refused_and_nothing_is_written(results, tmp_path, capsys):
    readme = tmp_path / "README.md"
    readme.write_text("# Mine\n")
    out = tmp_path / "out"
    for name in ("forward_model.csv", "learning.csv", "suite.csv"):
        (tmp_path / name).write_bytes((SHIPPED / name).read_bytes())
    options = ["--results", str(results.parent), "--out", str(out), "--only", "RESULTS", "--readme", str(readme)]
    assert command(main, options) == 2
    assert "the README must have a section from <!-- results: made by" in capsys.readouterr().err
    assert readme.read_text() == "# Mine\n"
    assert not out.exists()


@pytest.mark.parametrize("name", SHIPPED_PAGES)
def test_a_page_of_another_kind_is_left_alone(tmp_path, capsys, name):
    page = tmp_path / f"{name}.md"
    page.write_text("# My thesis\n")
    assert command(main, ["--results", str(SHIPPED), "--out", str(tmp_path)]) == 2
    assert f"error: {page} was not made by claims.py" in capsys.readouterr().err
    assert page.read_text() == "# My thesis\n"
    assert [path.name for path in tmp_path.iterdir()] == [page.name]


def test_a_page_that_cannot_be_written_is_named(results, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert make_page(results, tmp_path / "file") == 2
    assert f"{tmp_path / 'file'} is no folder" in capsys.readouterr().err
    (tmp_path / "out" / "RESULTS.md").mkdir(parents=True)
    assert make_page(results, tmp_path / "out") == 2
    assert "RESULTS.md is a directory" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["RESULTS.md"]


def test_seeds_that_only_one_side_has_are_left_out_of_pairs_and_that_is_told(results, tmp_path):
    text = [line for line in results.read_text().splitlines() if ",grid," not in line]
    results.write_text("\n".join([*text, *rows("grid", seeds=range(4, SEEDS + 3))]) + "\n")
    assert make_page(results, tmp_path) == 0
    grid = cells((tmp_path / "RESULTS.md").read_text(), "grid")
    assert grid[2] == str(SEEDS - 1)
    assert grid[9].endswith(f"({SEEDS - 4} pairs)")


def test_a_run_that_is_under_way_is_counted_where_it_was_evaluated(results):
    lines = results.read_text().splitlines()
    results.write_text("\n".join(line for line in lines if ",sgim-d,3,1,0,5000," not in line) + "\n")
    found = read_results(results)["sgim-d"]
    assert set(found.at(5000)) == set(range(1, SEEDS))
    assert set(found.at(1000)) == set(range(SEEDS))
    assert found.curves()[1].shape == (SEEDS - 1, 7)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda text: text.replace("variant,teacher", "teacher,variant", 1), "must begin with experiment,variant"),
        (lambda text: "", "must begin with experiment,variant"),
        (lambda text: text.splitlines()[0] + "\n", "no line below its header"),
        (lambda text: text + "learners,random,,1,99,50", r"line \d+ has 6 fields, not 12"),
        (lambda text: text + "learners,random,,1,99,5000,own,nan,,3,,\n", "mean_error_m must be a finite number"),
        (lambda text: text + "learners,random,,1,99,5000,own,-1,,3,,\n", "mean_error_m must be a finite number"),
        (lambda text: text + "learners,random,,1,9.5,5000,own,1,,3,,\n", "seed must be a whole number, got '9.5'"),
        (lambda text: text + "learners,random,,1,99,5000,own,1,low,3,,\n", "noise_floor_m must be"),
        (lambda text: text + "learners,random,,1,0,5000,own,1,,3,,\n", "seed 0 of random is there twice at 5000"),
        (lambda text: text + "learners,random,,1,99,5000,own,1,,3,some,\n", "goals_claimed must be"),
        (lambda text: text + "baselines,random,,1,99,5000,own,1,,3,,\n", "on an earlier line .*rename one"),
    ],
)
def test_a_malformed_table_is_refused_in_one_line(results, tmp_path, capsys, spoil, message):
    results.write_text(spoil(results.read_text()))
    with pytest.raises(ResultsError, match=message):
        read_results(results)
    assert make_page(results, tmp_path) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {results}")
    assert said.count("\n") == 1
    assert not (tmp_path / "RESULTS.md").exists()


def test_a_table_that_is_not_there_is_refused_with_where_it_comes_from(tmp_path, capsys):
    assert make_page(tmp_path / "none" / "paper.csv", tmp_path) == 2
    assert "none/paper.csv does not exist; experiments/compare.py writes" in capsys.readouterr().err
    (tmp_path / "paper.csv").write_text("")  # the table outside its folder
    assert make_page(tmp_path / "paper.csv" / "paper.csv", tmp_path) == 2
    assert "paper.csv/paper.csv does not exist; experiments/compare.py writes" in capsys.readouterr().err


def test_more_near_goals_than_goals_are_refused(results):
    results.with_name("goals.csv").write_text("variant,seed,n_goals,n_near\nsgim-d-large,0,3,4\n")
    with pytest.raises(ResultsError, match="line 2: n_near must be at most n_goals"):
        read_goals(results.with_name("goals.csv"))


def test_the_help_teaches(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    said = capsys.readouterr().out
    assert all(name in said for name in PAGES)
    assert "experiments/pages/" in said
    assert "python experiments/claims.py --runs runs" in said


def test_what_an_earlier_version_said_stands_beside_what_is_said_now(results, tmp_path):
    lines = ["claim,number,verdict", f"{NAMES[0]},ratio 0.42,holds", f"{NAMES[1]},ratio 0.90,cannot say"]
    (tmp_path / "said.csv").write_text("\n".join(lines) + "\n")
    assert make_page(results, tmp_path / "pages") == 0
    page = (tmp_path / "pages/RESULTS.md").read_text()
    assert f"| {NAMES[0]} | ratio 0.42 | holds | ratio 0.40 [0.40, 0.40] | holds |" in page
    assert f"| {NAMES[1]} | ratio 0.90 | cannot say | ratio 0.75 [0.75, 0.75] | **holds** |" in page


def test_a_claim_that_was_made_and_is_not_judged_any_more_is_named(results, tmp_path, capsys):
    (tmp_path / "said.csv").write_text("claim,number,verdict\nIt flies,2 m,holds\n")
    assert make_page(results, tmp_path / "pages") == 2
    assert "said.csv has It flies, which is not judged any more" in capsys.readouterr().err
    assert not (tmp_path / "pages/RESULTS.md").exists()
