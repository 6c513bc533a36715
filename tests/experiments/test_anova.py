"""The analyses of variance of movements: what is compared, what counts as one movement, and where the table goes."""

import numpy as np
import pytest

import anova as command
from anova import compare, main, mean_thetas, random_thetas, shown_by
from claims import EMPTY
from evidence import NotRun
from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Demonstration

SHIFTED = 4  # knots of the first joint


@pytest.fixture
def demonstrators(tmp_path, monkeypatch):
    """Demonstrator 3 keeps its first joint in the upper part of its range, 1 moves at random, 2 has no file."""
    primitive, rng = FishingRod().primitive, np.random.default_rng(1)
    thetas = {1: rng.random((60, 25)), 3: rng.random((60, 25))}
    thetas[3][:, :SHIFTED] = rng.uniform(0.6, 1.0, (60, SHIFTED))
    for number, each in thetas.items():
        shown = [Demonstration(np.zeros(0), *primitive.trajectory(theta), np.zeros(2)) for theta in each]
        save_demonstrations(tmp_path / f"{number}.npz", shown)
    monkeypatch.setattr(command, "shipped", lambda number: tmp_path / f"{number}.npz")
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


def found(lines, groups):
    (line,) = (line for line in lines if line.groups == groups)
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
    lines = compare(runs)
    structured = found(lines, "demonstrator 3, random movements")
    assert structured.rows == "60, 60 movements"
    assert (structured.found.adjusted < 0.001).tolist() == [True] * SHIFTED + [False] * 21
    assert found(lines, "demonstrator 1, random movements").found.rejected == 0
    assert "2.npz; scripts/make_teachers.py makes it" in found(lines, "demonstrator 2, random movements").found


def test_a_run_counts_as_one_movement_its_mean(runs):
    means = mean_thetas(runs, "sgim-d")
    assert means.shape == (2, 25)
    np.testing.assert_array_equal(means[1], read_run(runs / "sgim-d/seed-001").thetas.mean(axis=0))


def test_runs_that_are_missing_or_not_finished_are_told(demonstrators, runs):
    lines = compare(runs)
    assert found(lines, "SGIM-D taught by demonstrator 3, Random").rows == "2, 2 runs"
    told = f"not run: sgim-d-teacher-2, 1 finished in {runs}, at least 2 are needed"
    assert found(lines, "SGIM-D taught by demonstrator 2, Random").found == told
    assert found(lines, "SGIM-D taught by demonstrators 1, 2, 3").found == told
    with pytest.raises(NotRun, match="nobody, 0 finished"):
        mean_thetas(runs, "nobody")


@pytest.mark.parametrize("before", [None, EMPTY, "Prose.\n<!-- anova -->\nold\n<!-- end of anova -->\nMore.\n"])
def test_the_table_is_told_and_written_in_its_place(demonstrators, tmp_path, capsys, before):
    out = tmp_path / "new/RESULTS.md"
    if before is not None:
        out.parent.mkdir()
        out.write_text(before)
    assert main(["--runs", str(tmp_path / "none"), "--out", str(out)]) == 0
    text = out.read_text()
    table = text[text.index("<!-- anova -->\n") : text.index("<!-- end of anova -->")]
    assert "| demonstrator 3, random movements | 60, 60 movements | 4 of 25 |" in table
    assert "not run: sgim-d-teacher-1, 0 finished" in table
    assert "\nold\n" not in table
    assert "| demonstrator 3, random movements |" in capsys.readouterr().out
    kept = EMPTY if before is None else before
    assert text.startswith(kept[:7])
    assert text.count("<!-- claims -->") == kept.count("<!-- claims -->")
    assert main(["--runs", str(tmp_path / "none"), "--out", str(out)]) == 0
    assert out.read_text() == text


def test_a_place_marked_by_half_is_refused_and_left_alone(demonstrators, tmp_path, capsys):
    out = tmp_path / "RESULTS.md"
    out.write_text("<!-- anova -->\n")
    assert main(["--runs", str(tmp_path), "--out", str(out)]) == 2
    assert "and below it the line <!-- end of anova -->" in capsys.readouterr().err
    assert out.read_text() == "<!-- anova -->\n"


def test_a_damaged_recording_is_named(demonstrators, tmp_path, capsys):
    (tmp_path / "3.npz").write_text("junk")
    assert main(["--runs", str(tmp_path), "--out", str(tmp_path / "RESULTS.md")]) == 2
    assert f"error: {tmp_path / '3.npz'} is no demonstration file" in capsys.readouterr().err
    assert not (tmp_path / "RESULTS.md").exists()
