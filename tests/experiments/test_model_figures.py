"""Figures and table of forward models, from records that are made here row by row."""

import csv
import math

import numpy as np
import pytest

from model_figures import LATE, figure_of, main, row
from runs import edit
from sgimd_torch.record import Event, Kind, Record
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.process import command
from sgimd_torch.spaces import stream
from sgimd_torch.views.model_run import read_model_run

FIRST = 50  # exemplars that are learnt before anything is predicted
SPREAD = 0.1


def write_run(
    path, *, movements=120, dim=2, doubt=1.0, rests=0, naive=0, task_space=1.0, seconds=0.5, first=FIRST, seed=0
):
    """A run whose outcomes scatter around what was predicted; the spread that it names is ``doubt`` times as large.

    The first ``naive`` outcomes scatter ten times as much. It rests first. Then two movements pursue each goal; one
    goal is met by the first of them, the next by the second.
    """
    rng, n = stream(0, "run"), movements - rests
    means = rng.uniform(-0.7, 0.7, (n, dim))
    outcomes = means + SPREAD * rng.normal(size=(n, dim))
    outcomes[:naive] += 9 * (outcomes - means)[:naive]
    theta, context, noise = np.zeros(1), np.zeros(0), np.full(dim, doubt * SPREAD)
    spreads = np.tile(np.concatenate([0.6 * noise, 0.8 * noise]), (n, 1))  # sides of 3, 4 and 5
    path.mkdir(parents=True)
    with Record.make(path / FILE, (0, 1, dim), about_of(movements, dim, task_space, seconds, seed)) as record:
        for _ in range(rests):
            record.add(Event(Kind.RESTED, context))
        for exemplar, outcome in enumerate(outcomes):
            goal = outcomes[exemplar // 2 * 2 + exemplar // 2 % 2]
            record.add(Event(Kind.MOVED, context, theta, goal, outcome, "local"))
        predictions = np.hstack([outcomes, means, spreads])[first:].tolist()
        record.add_rows("predictions", [(exemplar, *values) for exemplar, values in enumerate(predictions, first)])
        refreshes = [(at + rests, at, 20, 0.5 - at / 1000, 0.1, int(at == 100)) for at in range(50, n + 1, 50)]
        record.add_rows("refreshes", refreshes)
        record.commit()
    return path


def about_of(movements, dim, task_space, seconds, seed):
    settings = {"seed": seed, "movements": movements, "evaluate_at": [], "environment.task_space": task_space}
    spaces = {name: ([0.0] * n, [1.0] * n) for name, n in (("contexts", 0), ("policies", 1), ("outcomes", dim))}
    known = {} if seconds is None else {"seconds": {"seconds_model": seconds}}
    return {"settings": settings, "versions": {}, "files": {}, "robot": "Robot", "spaces": spaces, **known}


def table_of(out):
    with open(out / "table.csv", newline="") as file:
        return [{k: v if k == "run" else float(v or "nan") for k, v in told.items()} for told in csv.DictReader(file)]


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    """A long run: 3010 movements, the first 10 at rest; its model has learnt to predict after 1900."""
    return write_run(tmp_path_factory.mktemp("runs") / "sgim-d" / "seed-000", movements=3010, rests=10, naive=1890)


@pytest.fixture
def short(tmp_path):
    return write_run(tmp_path / "runs" / "sgim-d" / "seed-001", seed=1)


def refused(path, capsys, *options):
    """What main says of a run that it refuses, without having written anything."""
    out = path.parents[2] / "refused"
    assert command(main, [str(path), *options, "--out", str(out)]) == 2
    assert not out.exists()
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    return said[0]


def test_the_table_tells_error_coverage_refinements_and_refreshes(honest, tmp_path, capsys):
    assert command(main, [str(honest), "--out", str(tmp_path / "out")]) == 0
    (told,) = table_of(tmp_path / "out")
    assert told["run"] == "sgim-d/seed-000"
    assert told["predicted"] == 3000 - FIRST
    assert told["error"] == pytest.approx(SPREAD * math.sqrt(math.pi / 2), rel=0.07)  # Rayleigh, 4 standard errors
    for level in (50, 80, 95):  # 4 standard errors of a share of 1000
        assert told[f"inside_{level}_last"] == pytest.approx(level / 100, abs=0.064)
        assert told[f"inside_{level}_late"] == pytest.approx(level / 100, abs=0.064)
    assert told["improved"] == 0.5
    assert (told["refreshes"], told["diverged"]) == (60, 1)
    assert told["ms_per_refresh"] == pytest.approx(500 / 60)
    head, line, where = capsys.readouterr().out.splitlines()
    assert head.split()[:2] == ["run", "predicted"]
    assert f"{100 * told['inside_80_late']:.0f} / {100 * told['inside_95_late']:.0f}" in line
    assert "60, 1 diverged" in line
    assert str(tmp_path / "out") in where


def test_only_predictions_from_2000_movements_on_count_as_late(honest):
    run = read_model_run(honest)
    assert run.movements[0] == FIRST + 10  # exemplar 50 was lived after ten rests
    late = run.movements >= LATE
    assert late.sum() == 3010 - LATE
    expected = np.linalg.norm((run.observed - run.mean)[-1010:] / SPREAD, axis=1) ** 2 <= -2 * math.log(0.2)
    assert run.inside(late, [0.8]) == expected.mean()


def test_an_overconfident_model_differs_from_an_honest_and_a_cautious_one(tmp_path):
    runs = [write_run(tmp_path / str(doubt), movements=600, doubt=doubt) for doubt in (0.3, 3)]
    small, large = (row(read_model_run(run)) for run in runs)
    assert small["inside_95_last"] < 0.4  # 1 - .05^.09 = .24
    assert large["inside_50_last"] > 0.98  # 1 - .5^9


def test_what_is_not_known_is_a_dash_and_not_a_number(tmp_path, capsys):
    path = write_run(tmp_path / "x" / "seed-000", seconds=None)
    assert command(main, [str(path), "--out", str(tmp_path / "out")]) == 0
    line = capsys.readouterr().out.splitlines()[1]
    assert "- / - / -" in line  # it never came to 2000 movements
    assert line.endswith("-")  # nor is it known how long refreshes took


def test_each_run_gets_a_line_and_the_first_of_a_variant_a_figure_the_same_again(short, honest, tmp_path):
    assert command(main, [str(short), str(honest), "--out", str(tmp_path / "both")]) == 0
    assert [told["run"] for told in table_of(tmp_path / "both")] == ["sgim-d/seed-001", "sgim-d/seed-000"]
    files = {path.name for path in (tmp_path / "both").iterdir()}
    assert files == {"sgim-d-seed-001.png", "table.csv"}
    assert command(main, [str(short), "--out", str(tmp_path / "again")]) == 0
    pictures = [(tmp_path / out / "sgim-d-seed-001.png").read_bytes() for out in ("both", "again")]
    assert pictures[0] == pictures[1]
    assert pictures[0].endswith(b"IEND\xaeB`\x82")


def test_the_figure_shows_the_last_thousand_and_windows_of_all(honest):
    axes = {ax.get_ylabel(): ax for ax in figure_of(read_model_run(honest)).axes}
    errors = axes["mean error of predictions (m)"].lines[0]
    assert errors.get_xdata()[-1] == 3010
    assert len(errors.get_xdata()) == (3000 - FIRST) // 250
    maps = [ax for ax in figure_of(read_model_run(honest)).axes if ax.get_ylabel() == "y (m)"]
    assert len(maps[0].collections[0].get_segments()) == 1000
    assert axes["outcomes inside the 80 % region"].lines[1].get_ydata()[-1] == pytest.approx(0.8, abs=0.1)
    held_out = axes["held-out negative log likelihood"].lines[0]
    assert held_out.get_xydata()[0].tolist() == [60, 0.45]
    labels = [text.get_text() for text in axes["outcomes inside"].get_legend().get_texts()]
    assert [label.split(":")[0] for label in labels] == ["ideal", "last 1000", "from 2000 movements on"]


def test_outcomes_of_three_dimensions_have_all_but_the_maps_of_the_plane(tmp_path):
    run = read_model_run(write_run(tmp_path / "run", movements=1000, dim=3))
    assert row(run)["inside_80_last"] == pytest.approx(0.8, abs=0.055)  # chi-square of 3 degrees, 4 standard errors
    labels = {ax.get_ylabel() for ax in figure_of(run).axes}
    assert "outcomes inside" in labels
    assert "y (m)" not in labels


def test_a_task_space_that_nothing_reached_leaves_the_map_empty(tmp_path):
    axes = figure_of(read_model_run(write_run(tmp_path / "run", task_space=1e-6))).axes
    assert "70 of 70 landed outside" in [text.get_text() for ax in axes for text in ax.texts]


def test_a_run_without_a_model_says_so(tmp_path, capsys):
    """Nor can one be shown that has predicted nothing yet."""
    path = write_run(tmp_path / "runs" / "x" / "seed-000", first=120)
    said = refused(path, capsys)
    assert f"{path} holds no prediction of a forward model" in said
    assert "learns from 50 movements before its first" in said


def test_a_folder_that_is_no_run_is_named(tmp_path, capsys):
    assert f"{tmp_path / 'a' / 'b' / 'c'} holds no run" in refused(tmp_path / "a" / "b" / "c", capsys)


@pytest.mark.parametrize("table", ["predictions", "refreshes", "events"])
def test_a_damaged_row_is_named(short, capsys, table):
    edit(short / FILE, f"DELETE FROM {table} WHERE rowid = 1")
    assert f"row 1 of {table} is not what was written" in refused(short, capsys)


def test_a_spread_of_nothing_is_refused_before_anything_is_written(tmp_path, capsys):
    path = write_run(tmp_path / "runs" / "x" / "seed-000", doubt=0.0)
    assert "spread must be above 0, but entry [0, 0] is 0.0" in refused(path, capsys)


def test_two_runs_of_one_name_are_not_drawn_over_each_other(short, capsys):
    assert "the same name" in refused(short, capsys, str(short))


def test_what_stands_in_the_way_of_the_figures_is_named(short, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert command(main, [str(short), "--out", str(tmp_path / "file")]) == 2
    assert f"{tmp_path / 'file'} is no folder" in capsys.readouterr().err
    (tmp_path / "out" / "sgim-d-seed-001.png").mkdir(parents=True)
    assert command(main, [str(short), "--out", str(tmp_path / "out")]) == 2
    assert "sgim-d-seed-001.png is a directory" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["sgim-d-seed-001.png"]
