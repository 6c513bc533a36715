"""The analyses of variance of movements: what is compared, what counts as one movement, and where the table goes."""

import numpy as np
import pytest
from scipy import stats

import anova
from anova import COMPARISONS, anova_cells, mean_thetas, random_thetas, shown_by, update_anova
from claims import main
from judging import NotRun
from made_up import write_paper
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
    """Two seeds of 12 movements each; of the pupil of demonstrator 2 only one."""
    out = tmp_path_factory.mktemp("runs")
    for name in ("random", "sgim-d", "sgim-d-teacher-1", "sgim-d-teacher-2"):
        algorithm = "random" if name == "random" else "sgim-d"
        for seed in (0,) if name == "sgim-d-teacher-2" else (0, 1):
            options = f"--algorithm {algorithm} --name {name} --seed {seed} --movements 12 --evaluate_at []"
            assert go(out, *options.split()) == 0
    return out


def test_recordings_are_compared_by_the_thetas_that_reproduce_them(demonstrators):
    np.testing.assert_allclose(shown_by(3), demonstrators[3], atol=1e-6)


def test_random_movements_are_uniform_and_those_of_two_demonstrators_differ():
    thetas = random_thetas(400, "one")
    np.testing.assert_array_equal(thetas, random_thetas(400, "one"))
    assert not np.isin(thetas, random_thetas(400, "another")).any()
    assert thetas.shape == (400, 25)
    np.testing.assert_allclose(thetas.mean(axis=0), 0.5, atol=0.07)  # 4.8 standard errors


def test_groups_are_compared_and_what_is_missing_is_told(demonstrators, runs, tmp_path, capsys):
    update_anova(tmp_path, runs)
    rows = {row[0]: row[1:] for row in anova_cells(tmp_path)}
    assert [*rows] == [*COMPARISONS]
    assert rows["demonstrator 3, random movements"][:2] == ["60, 60 movements", f"{SHIFTED} of 25"]
    assert rows["demonstrator 1, random movements"][1] == "0 of 25"
    assert rows["SGIM-D taught by demonstrator 3, Random"][0] == "2, 2 runs"
    unmade = [groups for groups, row in rows.items() if row[1] == "not run"]
    assert unmade == [groups for groups in COMPARISONS if "demonstrator 2" in groups or "demonstrators" in groups]
    said = capsys.readouterr().err
    assert "2.npz; scripts/make_teachers.py makes it" in said
    assert f"sgim-d-teacher-2, 1 finished in {runs}, at least 2 are needed" in said
    before = (tmp_path / "anova.csv").read_text()
    update_anova(tmp_path, tmp_path / "none")  # earlier rows stay
    assert (tmp_path / "anova.csv").read_text() == before
    with pytest.raises(NotRun, match="nobody, 0 finished"):
        mean_thetas(runs, "nobody")


def test_a_run_counts_as_one_movement_its_mean(runs):
    means = mean_thetas(runs, "sgim-d")
    assert means.shape == (2, 25)
    np.testing.assert_array_equal(means[1], read_run(runs / "sgim-d/seed-001").thetas.mean(axis=0))


def test_the_page_has_the_analyses_of_these_runs(demonstrators, runs, tmp_path):
    options = ["--results", write_paper(tmp_path), "--runs", runs, "--out", tmp_path, "--only", "RESULTS"]
    assert command(main, list(map(str, options))) == 0
    text = (tmp_path / "RESULTS.md").read_text()
    assert "| demonstrator 3, random movements | 60, 60 movements | 4 of 25 |" in text
    assert "| SGIM-D taught by demonstrator 2, Random | - | not run |" in text


def test_a_damaged_recording_is_named(demonstrators, tmp_path):
    (tmp_path / "3.npz").write_text("junk")
    with pytest.raises(ValueError, match=r"3\.npz"):
        update_anova(tmp_path / "out", tmp_path)


def test_anova_finds_the_dimensions_in_which_means_differ(rng):
    shift = np.array([0, 0, 1.0, 0, 2.0])
    found = anova.anova(rng.normal(size=(40, 5)), rng.normal(size=(60, 5)) + shift)
    assert (found < 0.001).tolist() == [False, False, True, False, True]


def test_random_groups_are_seldom_told_apart_however_many_dimensions_there_are(rng):
    """In 25 dimensions uncorrected tests would find a difference that is none in 72 % of cases."""
    wrong = [anova.anova(rng.random((30, 25)), rng.random((30, 25))).min() <= 0.05 for _ in range(200)]
    assert np.mean(wrong) < 0.11  # .05 expected, standard error .015


def test_p_of_two_groups_are_those_of_t_tests_adjusted_by_holm(rng):
    """The smallest p times 3, the next times 2, the last times 1; never falling."""
    first, second = rng.normal(size=(30, 3)), rng.normal([0.9, 0.5, 0.2], size=(30, 3))
    a, b, c = np.sort(stats.ttest_ind(first, second).pvalue)
    expected = [3 * a, max(3 * a, 2 * b), max(3 * a, 2 * b, c)]
    np.testing.assert_allclose(np.sort(anova.anova(first, second)), np.minimum(expected, 1))


def test_thetas_at_rest_are_refused():
    with pytest.raises(ValueError, match="at rest"):
        anova.anova(np.eye(3), np.full((3, 3), np.nan))
