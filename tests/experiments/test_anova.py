"""The analyses of variance of movements: what is compared, what counts as one movement, and where the table goes."""

import csv

import numpy as np
import pytest
from scipy import stats

import anova
from anova import COMPARISONS, anova_cells, compare, mean_thetas, random_thetas, shown_by
from claims import main
from judging import NotRun
from paper import write_paper
from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Demonstration, stream

SHIFTED = 4  # knots of the first joint


@pytest.fixture
def rng():
    return stream(0, "test")


@pytest.fixture
def demonstrators(tmp_path, monkeypatch):
    """Demonstrator 3 keeps its first joint in the upper part of its range, 1 moves at random, 2 has no file."""
    primitive, rng = FishingRod().primitive, np.random.default_rng(1)
    thetas = {1: rng.random((60, 25)), 3: rng.random((60, 25))}
    thetas[3][:, :SHIFTED] = rng.uniform(0.6, 1.0, (60, SHIFTED))
    for number, each in thetas.items():
        shown = [Demonstration(np.zeros(0), *primitive.trajectory(theta), np.zeros(2)) for theta in each]
        save_demonstrations(tmp_path / f"{number}.npz", shown)
    monkeypatch.setattr(anova, "shipped", lambda number: tmp_path / f"{number}.npz")
    return thetas


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    """Two seeds of 12 movements each; of the pupil of demonstrator 2 only one, and one that was stopped."""
    out = tmp_path_factory.mktemp("runs")
    for name in ("random", "sgim-d", "sgim-d-teacher-1", "sgim-d-teacher-2"):
        algorithm = "random" if name == "random" else "sgim-d"
        for seed in (0, 1):
            options = f"--algorithm {algorithm} --name {name} --seed {seed} --movements 12 --evaluate_at []"
            assert go(out, *options.split()) == 0
    summary = out / "sgim-d-teacher-2/seed-001/summary.json"
    summary.write_text(summary.read_text().replace('"finished": true', '"finished": false'))
    return out


def found(compared, groups):
    (line,) = (line for line in compared if line.groups == groups)
    return line


def test_recordings_are_compared_by_the_thetas_that_reproduce_them(demonstrators):
    np.testing.assert_allclose(shown_by(3), demonstrators[3], atol=1e-6)


def test_random_movements_are_uniform_and_those_of_two_demonstrators_differ():
    thetas = random_thetas(400, "one")
    np.testing.assert_array_equal(thetas, random_thetas(400, "one"))
    assert not np.isin(thetas, random_thetas(400, "another")).any()
    assert thetas.shape == (400, 25)
    np.testing.assert_allclose(thetas.mean(axis=0), 0.5, atol=0.07)  # 4.8 standard errors


def test_a_structured_demonstrator_differs_from_random_movements_where_it_is_structured(demonstrators, runs):
    compared, missing = compare(runs)
    structured = found(compared, "demonstrator 3, random movements")
    assert structured.rows == "60, 60 movements"
    assert (structured.found.adjusted < 0.001).tolist() == [True] * SHIFTED + [False] * 21
    assert found(compared, "demonstrator 1, random movements").found.rejected == 0
    assert "2.npz; scripts/make_teachers.py makes it" in missing["demonstrator 2, random movements"]


def test_a_run_counts_as_one_movement_its_mean(runs):
    means = mean_thetas(runs, "sgim-d")
    assert means.shape == (2, 25)
    np.testing.assert_array_equal(means[1], read_run(runs / "sgim-d/seed-001").thetas.mean(axis=0))


def test_runs_that_are_missing_or_not_finished_are_reported(demonstrators, runs):
    compared, missing = compare(runs)
    assert found(compared, "SGIM-D taught by demonstrator 3, Random").rows == "2, 2 runs"
    told = f"sgim-d-teacher-2, 1 finished in {runs}, at least 2 are needed"
    assert missing["SGIM-D taught by demonstrator 2, Random"] == told
    assert missing["SGIM-D taught by demonstrators 1, 2, 3"] == told
    with pytest.raises(NotRun, match="nobody, 0 finished"):
        mean_thetas(runs, "nobody")


def make_page(out, runs):
    """The exit code of making RESULTS.md in ``out`` with the analyses of variance of ``runs``."""
    write_paper(out / "paper.csv")
    options = ["--results", out, "--runs", runs, "--out", out, "--only", "RESULTS"]
    return command(main, list(map(str, options)))


def test_the_table_is_kept_and_written_in_its_place(demonstrators, runs, tmp_path, capsys):
    assert make_page(tmp_path, runs) == 0
    text, said = (tmp_path / "RESULTS.md").read_text(), capsys.readouterr().err
    table = text[text.index("| means compared |") : text.index("The paper rejects randomness")]
    assert "| demonstrator 3, random movements | 60, 60 movements | 4 of 25 |" in table
    assert "| SGIM-D taught by demonstrator 2, Random | - | not run |" in table
    assert [line.split(" | ")[0] for line in table.splitlines()[2:9]] == [f"| {groups}" for groups in COMPARISONS]
    assert "SGIM-D taught by demonstrator 2, Random: not run: sgim-d-teacher-2, 1 finished" in said
    with open(tmp_path / "anova.csv", newline="") as file:
        rows = {row["compared"]: row for row in csv.DictReader(file)}
    p = found(compare(runs)[0], "SGIM-D taught by demonstrator 3, Random").found.adjusted
    kept = rows["SGIM-D taught by demonstrator 3, Random"]
    assert (float(kept["smallest_p"]), float(kept["largest_p"])) == (p.min(), p.max())
    assert len(rows) == len(COMPARISONS) - 3  # of demonstrator 2 nothing


def test_without_run_directories_the_rows_of_earlier_ones_are_kept(demonstrators, runs, tmp_path, capsys):
    assert make_page(tmp_path, runs) == 0
    page, table = ((tmp_path / name).read_text() for name in ("RESULTS.md", "anova.csv"))
    assert make_page(tmp_path, tmp_path / "none") == 0
    assert (tmp_path / "RESULTS.md").read_text() == page
    assert (tmp_path / "anova.csv").read_text() == table
    assert "Random: not run: sgim-d, 0 finished" in (said := capsys.readouterr().err)
    assert "its row stays the same" in said


def test_what_was_never_compared_says_so(tmp_path):
    assert anova_cells(tmp_path / "none.csv") == [[groups, "-", "not run", "", ""] for groups in COMPARISONS]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("demonstrator 1\n", "anova.csv must begin with compared,of,differ"),
        ("{header}\na,b,1,25,0.1\n", "anova.csv, line 2 has 5 fields, not 6"),
        ("{header}\na,b,1,25,small,1\n", "anova.csv, line 2: smallest_p must be a finite number"),
    ],
)
def test_a_damaged_table_is_refused_and_no_page_written(tmp_path, capsys, text, says):
    write_paper(tmp_path / "paper.csv")
    (tmp_path / "anova.csv").write_text(text.format(header=",".join(anova.HEADER)))
    assert command(main, ["--results", str(tmp_path), "--out", str(tmp_path), "--only", "RESULTS"]) == 2
    assert f"error: {tmp_path}/{says}" in capsys.readouterr().err
    assert not (tmp_path / "RESULTS.md").exists()


def test_a_damaged_recording_is_named(demonstrators, tmp_path, capsys):
    (tmp_path / "3.npz").write_text("junk")
    assert make_page(tmp_path / "out", tmp_path) == 2
    assert f"error: {tmp_path / '3.npz'} is no demonstration file" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["paper.csv"]


def test_anova_finds_the_dimensions_in_which_means_differ(rng):
    shift = np.array([0, 0, 1.0, 0, 2.0])
    found = anova.anova(rng.normal(size=(40, 5)), rng.normal(size=(60, 5)) + shift)
    assert (found.adjusted < 0.001).tolist() == [False, False, True, False, True]
    assert found.rejected == 2
    assert found.adjusted.min() == pytest.approx(5 * found.p.min())


def test_anova_of_two_groups_is_the_t_test(rng):
    a, b = rng.normal(size=(20, 3)), rng.normal(size=(30, 3))
    np.testing.assert_allclose(anova.anova(a, b).p, stats.ttest_ind(a, b).pvalue)


def test_random_groups_are_seldom_told_apart_however_many_dimensions_there_are(rng):
    """In 25 dimensions uncorrected tests would find a difference that is none in 72 % of cases."""
    wrong = [anova.anova(rng.random((30, 25)), rng.random((30, 25))).rejected > 0 for _ in range(200)]
    assert np.mean(wrong) < 0.11  # .05 expected, standard error .015


def test_the_adjusted_p_are_holms(rng):
    """The smallest p times 3, the next times 2, the last times 1; never falling."""
    found = anova.anova(rng.normal(size=(30, 3)), rng.normal([0.9, 0.5, 0.2], size=(30, 3)))
    a, b, c = np.sort(found.p)
    expected = [3 * a, max(3 * a, 2 * b), max(3 * a, 2 * b, c)]
    np.testing.assert_allclose(np.sort(found.adjusted), np.minimum(expected, 1))
    assert found.adjusted[found.p.argmin()] == pytest.approx(3 * a)


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda: anova.anova(np.ones((3, 2))), "two or more groups"),
        (lambda: anova.anova(np.ones((3, 2)), np.ones((3, 4))), "two or more groups"),
        (lambda: anova.anova(np.ones((3, 2)), np.ones((1, 2))), "2 or more rows"),
        (lambda: anova.anova(np.eye(3), np.full((3, 3), np.nan)), "at rest"),
        (lambda: anova.anova(np.tile([0.0, 1, 2], (3, 1)) * np.arange(3)[:, None], np.zeros((3, 3))), r"\[0\]"),
    ],
)
def test_groups_that_cannot_be_compared_are_refused_with_the_reason(refused, message):
    with pytest.raises(ValueError, match=message):
        refused()
