"""The figures of the results: what they show, read back from their axes, and what happens without their data."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from figures import FIGURES, Data, main
from judging import LEARNERS, NotRun, Results
from made_up import MOVEMENTS, PAPER, SEEDS, error, middle, write_paper
from runs import ROOT
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import JOINTS
from sgimd_torch.figures.learning import COLOURS, NAMES
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from variants import PAPER as EXPERIMENTS_OF_THE_PAPER

LIVED = [("random", 1), ("sagg-riac", 1), ("imitation", 1), ("sgim-d", 1), ("sagg-riac", 100), ("sgim-d", 100)]
NEEDS_RUNS = {"landing", "goals"}


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    """Two seeds of the learners that are pooled, 40 movements each, the 30th after a demonstration."""
    out = tmp_path_factory.mktemp("runs")
    for algorithm, task_space in LIVED:
        name = algorithm if task_space == 1 else f"{algorithm}-large"
        for seed in (0, 1) if name in ("random", "sgim-d-large") else (0,):
            options = f"--algorithm {algorithm} --name {name} --environment.task_space {task_space} --seed {seed}"
            assert go(out, *options.split(), "--movements", "40", "--evaluate_at", "[]") == 0
    return out


def results(folder):
    return Results.of(folder, (*EXPERIMENTS_OF_THE_PAPER, "swimmer")).by("linear")


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    return write_paper(tmp_path_factory.mktemp("results"))


@pytest.fixture
def data(paper, runs):
    return Data(results(paper), runs)


def draw(*options):
    """The exit code of the command."""
    return command(main, list(map(str, options)))


def lines_of(ax):
    """The labelled lines of an axis, by label."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def test_every_figure_is_written_whole_in_both_forms(paper, runs, tmp_path, capsys):
    assert draw("--results", paper, "--runs", runs, "--out", tmp_path) == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{kind}" for name in {*FIGURES} - {"swimmer"} for kind in ("png", "svg")
    }
    said = capsys.readouterr().out
    for name in {*FIGURES} - {"swimmer"}:
        assert (tmp_path / f"{name}.png").read_bytes().endswith(b"IEND\xaeB`\x82")
        assert (tmp_path / f"{name}.svg").read_text().rstrip().endswith("</svg>")
        assert f"{tmp_path / name}.png" in said


def test_the_swimmer_is_shown_by_who_explored_and_who_answered():
    found = results(ROOT / "results")
    figure = FIGURES["swimmer"](Data(found, ROOT))
    ends = [{name.split(" (")[0]: line.get_ydata()[-1] for name, line in lines_of(ax).items()} for ax in figure.axes]
    assert all({*end} == {"Random", "SAGG-RIAC", "SGIM-D", "Practice"} for end in ends[:3])
    assert {*ends[3]} == {"Random", "SAGG-RIAC", "SGIM-D"}
    assert ends[2]["Practice"] == found.by("process").iqm("practice-swimmer", 2000).value < ends[1]["Practice"]
    assert ends[0]["SGIM-D"] == found.by("nearest").iqm("sgim-d-swimmer", 2000).value


def test_the_same_results_give_the_same_files(paper, tmp_path):
    for out in ("a", "b"):
        assert draw("--results", paper, "--only", "errors", "--out", tmp_path / out) == 0
    for kind in ("png", "svg"):
        assert (tmp_path / "a" / f"errors.{kind}").read_bytes() == (tmp_path / "b" / f"errors.{kind}").read_bytes()


def test_the_errors_of_five_learners_show_their_seeds_their_number_and_their_noise(data):
    (ax,) = FIGURES["errors"](data).axes
    lines = lines_of(ax)
    assert set(lines) == {f"{name} ({SEEDS} seeds)" for name in map(NAMES.get, LEARNERS)}
    line = lines[f"SGIM-D ({SEEDS} seeds)"]
    assert to_hex(line.get_color()) == COLOURS["sgim-d"]
    np.testing.assert_array_equal(line.get_xdata(), MOVEMENTS)
    assert line.get_ydata()[-1] == pytest.approx(middle(0.08))
    thin = [other for other in ax.lines if other.get_color() == COLOURS["sgim-d"] and len(other.get_xdata()) == 7]
    assert len(thin) == SEEDS + 1
    floors = [other.get_ydata()[0] for other in ax.lines if other.get_marker() == "_"]
    assert len(floors) == 5
    assert floors[-1] == pytest.approx(0.9 * middle(0.08))
    assert ax.get_legend().get_texts()[-1].get_text() == "noise floor of each at 5000"


def test_each_demonstrator_has_a_panel_and_sagg_riac_is_in_all(data):
    panels = FIGURES["demonstrators"](data).axes
    assert [ax.get_title().split(":")[0] for ax in panels] == [f"Demonstrator {k}" for k in (1, 2, 3)]
    for ax, last in zip(panels, (0.09, 0.09, 0.08), strict=True):
        lines = lines_of(ax)
        assert [label.split(" (")[0] for label in lines] == [
            "Observation",
            "Imitation",
            "SGIM-D",
            "SAGG-RIAC, not taught",
        ]
        assert lines[f"SGIM-D ({SEEDS} seeds)"].get_ydata()[-1] == pytest.approx(middle(last))


def test_every_joint_of_every_recording_of_a_demonstrator_is_shown(data):
    axes = FIGURES["trajectories"](data).axes
    demonstrations = load_demonstrations()  # of demonstrator 3, whose row is the last
    for joint, ax in enumerate(axes[-len(JOINTS) :]):
        assert axes[joint].get_title() == JOINTS[joint].replace("_", " ")
        assert len(ax.lines) == len(demonstrations)
        np.testing.assert_array_equal(ax.lines[7].get_ydata(), demonstrations[7].trajectory[:, joint])
    assert "Demonstrator 3" in axes[-len(JOINTS)].get_ylabel()


def test_the_large_space_is_dashed_beside_the_small_one_in_the_same_colour(data):
    (ax,) = FIGURES["large_space"](data).axes
    small = lines_of(ax)[f"SGIM-D, T = [−1, 1]² ({SEEDS} seeds)"]
    large = lines_of(ax)[f"SGIM-D, T = [−100, 100]² ({SEEDS} seeds)"]
    assert (small.get_linestyle(), large.get_linestyle()) == ("-", "--")
    assert small.get_color() == large.get_color() == COLOURS["sgim-d"]
    assert large.get_ydata()[-1] == pytest.approx(middle(0.09))


def test_landing_points_of_all_seeds_are_pooled_on_one_scale(data):
    axes = {ax.get_title().split(" (")[0]: ax for ax in FIGURES["landing"](data).axes}
    maps = {name: axes[NAMES[name]].collections[0] for name in ("random", "sagg-riac", "imitation", "sgim-d")}
    assert len({mesh.norm.vmax for mesh in maps.values()}) == 1
    outcomes = np.concatenate([run.outcomes for run in data.runs("random")])
    assert len(outcomes) == 80
    assert maps["random"].get_array().sum() == (np.abs(outcomes) < 1.5).all(axis=1).sum()
    crosses = axes["SGIM-D"].lines[0]
    assert crosses.get_label() == f"{len(crosses.get_xdata())} demonstrated outcomes"
    shown = {int(row) for run in data.runs("sgim-d") for row in run.demonstration if row >= 0}
    assert len(crosses.get_xdata()) == len(shown) > 0
    tiles = axes["Tiles after 5000 movements"]
    assert [label.get_text() for label in tiles.get_yticklabels()] == [NAMES[name] for name in LEARNERS]
    assert 300 + (SEEDS - 1) / 2 in [line.get_xdata()[0] for line in tiles.lines]


@pytest.mark.parametrize("name", ["errors", "demonstrators", "landing"])
def test_an_additional_algorithm_leaves_the_figures_of_the_paper_as_they_are(data, monkeypatch, name):
    before = [(ax.get_title(), [*lines_of(ax)], len(ax.get_yticklabels())) for ax in FIGURES[name](data).axes]
    monkeypatch.setitem(NAMES, "toddler", "Toddler")
    monkeypatch.setitem(COLOURS, "toddler", "#000000")
    after = [(ax.get_title(), [*lines_of(ax)], len(ax.get_yticklabels())) for ax in FIGURES[name](data).axes]
    assert after == before


def test_the_goals_of_the_large_space_are_those_the_learner_chose_each_once(data):
    figure = FIGURES["goals"](data)
    run = read_run(data.folder / "sgim-d-large" / "seed-000")
    own = run.goals[np.isfinite(run.goals[:, 0]) & (run.origin != "imitate")]
    one = len(np.unique(own, axis=0))  # no goal comes again later: they are drawn from a continuum
    assert 1 < one < len(own)
    pooled = sum(
        len(np.unique(each.goals[np.isfinite(each.goals[:, 0]) & (each.origin != "imitate")], axis=0))
        for each in data.runs("sgim-d-large")
    )
    titles = [ax.get_title() for ax in figure.axes]
    assert f"SGIM-D: {pooled} goals (2 seeds)" in titles
    distances = next(ax for ax in figure.axes if ax.get_title() == "How far they lie")
    curve = lines_of(distances)["SGIM-D (2 seeds)"]
    assert curve.get_ydata()[-1] == 100
    assert curve.get_xdata()[-1] < 100 * np.sqrt(2)


def test_variants_are_sorted_and_their_difference_to_sgim_d_is_that_of_the_seeds(data):
    panels = {ax.get_title(loc="left"): ax for ax in FIGURES["variants"](data).axes}
    assert panels.keys() == {"The paper to the letter", "Other learners", "One part of SGIM-D changed"}
    ax = panels["One part of SGIM-D changed"]
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        f"{name} ({SEEDS} seeds)" for name in ("grid", "uniform-goals")
    ]
    centres = [line.get_xdata()[0] for line in ax.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(centres, [middle(0.079) - middle(0.08), middle(0.085) - middle(0.08)])


def test_figures_without_their_data_are_left_out_and_the_others_are_drawn(tmp_path, capsys):
    paper = write_paper(tmp_path, without=["sagg-riac"])
    assert draw("--results", paper, "--runs", tmp_path / "none", "--out", tmp_path / "out") == 0
    assert {path.stem for path in (tmp_path / "out").iterdir()} == {"variants", "trajectories"}
    said = capsys.readouterr().out
    assert "landing is left out; not run: run directories" in said
    for name in ("errors", "demonstrators", "large_space"):
        assert f"{name} is left out; not run: sagg-riac\n" in said


@pytest.mark.parametrize(
    ("missing", "left_out"),
    [
        ("random", {"errors", "large_space"}),
        ("sgim-d-large", {"large_space"}),
        ("sgim-d", {"errors", "large_space", "variants"}),
        ("imitation-teacher-1", set()),  # the other panels, and the other learners in this one, are there
    ],
)
def test_only_those_figures_are_left_out_that_need_a_variant(tmp_path, missing, left_out):
    data = Data(results(write_paper(tmp_path, without=[missing])), tmp_path)
    for name in set(FIGURES) - NEEDS_RUNS - {"swimmer"} - left_out:  # that one has rows of its own
        assert FIGURES[name](data).axes
    for name in left_out:
        with pytest.raises(NotRun):
            FIGURES[name](data)


def test_a_single_seed_is_drawn_without_an_interval(tmp_path):
    paper = write_paper(tmp_path, **{name.replace("-", "_"): {"seeds": [0]} for name in PAPER})
    (ax,) = FIGURES["errors"](Data(results(paper), tmp_path)).axes
    line = lines_of(ax)["Random (1 seed)"]
    np.testing.assert_allclose(line.get_ydata(), [error(0.2, 0, movements) for movements in MOVEMENTS])


@pytest.mark.parametrize("damage", ["table", "run"])
def test_damage_ends_with_one_line_and_no_traceback(paper, runs, tmp_path, capsys, damage):
    table, folder = tmp_path / "results.csv", tmp_path / "runs"
    table.write_text((paper / "results.csv").read_text() + ("junk\n" if damage == "table" else ""))
    (folder / "random" / "seed-000").mkdir(parents=True)
    (folder / "random" / "seed-000" / "run.sqlite").write_text("{")
    assert draw("--results", tmp_path, "--runs", folder, "--out", tmp_path / "out", "--only", "landing") == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("error: ")
    assert str(table if damage == "table" else folder) in said[-1]


def test_a_file_in_the_way_of_the_figures_is_named(paper, tmp_path, capsys):
    (tmp_path / "out").write_text("thesis")
    assert draw("--results", paper, "--out", tmp_path / "out") == 2
    assert f"{tmp_path / 'out'} is no folder" in capsys.readouterr().err


def test_the_help_names_every_figure(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    said = capsys.readouterr().out
    assert all(f"\n  {name} " in said for name in FIGURES)
    assert "python experiments/figures.py --results" in said
