"""The report does not flatter: few seeds, the baseline, colours, forward models, outliers, demonstrated outcomes."""

import dataclasses
import re

import numpy as np
import pytest
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.figure import Figure

from pages import Page, rows_of
from sgimd_torch import load_demonstrations
from sgimd_torch.board import pictures
from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.figures.learning import COLOURS
from sgimd_torch.runs.read import NO_EVALUATION, read_run
from sgimd_torch.views import statistics
from sgimd_torch.views.model_run import model_run
from sgimd_torch.views.report import command as report
from sgimd_torch.views.report import figures, model
from sgimd_torch.views.report import page as pages_of
from sgimd_torch.views.report.data import Life, Variant, demonstrated, read_life
from sgimd_torch.views.statistics import interquartile_mean, iqm_interval


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    """One short run."""
    out = tmp_path_factory.mktemp("runs")
    assert go(out, "--movements", 60, "--evaluate_at", 30) == 0
    return out


def variant_of(path, name, errors, movements=60):
    """Runs that are copies of the one at ``path`` with these last errors (m), one for each seed from 0 on."""
    life = read_life(path)
    lives = []
    for seed, error in enumerate(errors):
        evaluation = {**life.evaluation, "mean_error_m": np.array([0.5, error])}
        given = {**vars(life), "config": {**life.config, "seed": seed}, "answers": {**life.answers, "own": evaluation}}
        lives.append(Life(**{key: given[key] for key in Life.__dataclass_fields__}))
    return Variant(name, lives)


FIVE = [0.10, 0.12, 0.11, 0.14, 0.10]


def test_five_seeds_have_intervals_and_a_verdict_and_four_have_points_and_a_note(runs):
    run = runs / "sgim-d" / "seed-003"
    variants = [
        variant_of(run, "sgim-d", FIVE),
        variant_of(run, "worse", [error + 0.1 for error in FIVE]),
        variant_of(run, "alike", FIVE[::-1]),
        variant_of(run, "few", [error + 0.1 for error in FIVE[:4]]),
    ]
    text = pages_of.page(runs, variants, [])
    low, high = min(FIVE), max(FIVE)
    errors = {row[0]: row[4] for row in rows_of(text, "Errors")}
    found = iqm_interval(np.array(FIVE), rng=statistics.rng())
    assert low <= found.low < found.high <= high
    assert errors["SGIM-D"] == statistics.show(found, ".3f")
    assert errors["few"] == f"{interquartile_mean(np.array(FIVE[:4]) + 0.1):.3f}"
    rows = {row[0]: row[1:] for row in rows_of(text, "Last errors minus those of SGIM-D")[1:]}
    assert rows["worse"] == ["5", "+0.100 [+0.100, +0.100]", "worse"]
    assert rows["alike"][2] == "not told apart"
    assert rows["few"] == ["4", "+0.100", "fewer than 5 common seeds"]
    notes = text[: text.index('id="results"')]
    assert "Fewer than 5 seeds: few (4). They have points, but no intervals and no verdict." in notes
    lead = " ".join(re.sub("<[^>]*>", "", text[text.index('<p class="lead">') : text.index("<nav")]).split())
    assert "Compared with SGIM-D, seed by seed:" in lead
    assert all(said in lead for said in ("not told apart: alike", "worse: worse", "fewer than 5 common seeds: few"))


def test_the_baseline_is_the_one_that_was_chosen_and_another_name_is_refused(runs):
    run = runs / "sgim-d" / "seed-003"
    variants = [variant_of(run, "sgim-d", FIVE), variant_of(run, "random", [error + 0.1 for error in FIVE])]
    rows = rows_of(pages_of.page(runs, variants, [], "random"), "Last errors minus those of Random")[1:]
    assert rows == [["SGIM-D", "5", "-0.100 [-0.100, -0.100]", "better"]]
    with pytest.raises(ValueError, match=r"got 'ramdom'; these are random, sgim-d; did you mean random\?"):
        pages_of.page(runs, variants, [], "ramdom")
    variants.append(Variant("never", [dataclasses.replace(variants[0].lives[0], answers={"own": NO_EVALUATION})]))
    with pytest.raises(ValueError, match="a variant with errors to compare, got 'never'"):
        pages_of.page(runs, variants, [], "never")


def test_with_few_seeds_a_curve_has_points_in_the_place_of_a_band(runs):
    run = runs / "sgim-d" / "seed-003"
    for errors, points in ((FIVE[:4], 8), (FIVE, 0)):
        figure, variant = Figure(), variant_of(run, "sgim-d", errors)
        figures.curves.__wrapped__(
            figure, [variant, variant_of(run, "other", FIVE)], {"sgim-d": "red", "other": "blue"}
        )
        red = [drawn for drawn in figure.axes[0].collections if drawn.get_facecolor()[0][:3].tolist() == [1, 0, 0]]
        assert sum(len(drawn.get_offsets()) for drawn in red if isinstance(drawn, PathCollection)) == points
        assert len([drawn for drawn in red if isinstance(drawn, PolyCollection)]) == (points == 0)


def test_variants_of_one_algorithm_have_colours_of_their_own_whatever_their_results(runs):
    life = read_life(runs / "sgim-d" / "seed-003")
    names = ["b", "a", "sgim-d", "c"]
    colours = figures.colours_of([Variant(name, [life]) for name in names])
    assert colours["sgim-d"] == COLOURS["sgim-d"]
    assert len({*colours.values()}) == len(names)
    assert {*colours.values()} & {*COLOURS.values()} - {COLOURS["sgim-d"]} <= {COLOURS["cma-me"], COLOURS["map-elites"]}
    assert figures.colours_of([Variant(name, [life]) for name in names[::-1]]) == colours
    assert figures.colours_of([Variant("b", [life])]) == {"b": COLOURS["sgim-d"]}
    assert len(figures.colours_of([Variant(str(k), [life]) for k in range(30)])) == 30


@pytest.fixture(scope="module")
def modelled(tmp_path_factory, go):
    """Two seeds with a forward model, one too short for it to learn, and one without."""
    out = tmp_path_factory.mktemp("modelled")
    arm = (
        "--environment",
        "planar-arm-7",
        "--model.rate",
        2,
        "--evaluate_at",
        120,
        "--repeats",
        0,
        "--search",
        "gradient",
    )
    benchmark = out / "arm.npz"
    save_benchmark(benchmark, Benchmark("PlanarArm", np.array([[0.0, 0.6], [0.3, -0.5]]), 0.1))
    for seed, movements in ((0, 170), (1, 170), (2, 30)):
        options = ("--benchmark", benchmark, "--seed", seed, "--movements", movements, "--name", "model")
        assert go(out, *arm, "--inverse", "model", *options) == 0
    assert go(out, *arm[:-2], "--benchmark", benchmark) == 0
    return out


def test_a_run_with_a_forward_model_has_a_section_that_says_how_good_it_was_and_when_it_was_asked(modelled):
    assert report.main([str(modelled)]) == 0
    text = (modelled / "report.html").read_text(encoding="utf-8")
    head, *rows = rows_of(text, "Its predictions, each made before the model learnt from the movement")
    assert [row[0] for row in rows] == ["model, seed 0", "model, seed 1"]
    run = read_run(modelled / "model" / "seed-000")
    told = dict(zip(head, rows[0], strict=True))
    predicted = np.stack([run.predictions[f"predicted_{k}"] for k in (0, 1)], axis=1)
    outcomes = np.stack([run.predictions[f"outcome_{k}"] for k in (0, 1)], axis=1)
    assert told["predictions"] == str(len(predicted))
    assert told["error, last 1000 (m)"] == f"{np.linalg.norm(predicted - outcomes, axis=1).mean():.3f}"
    asked = np.zeros(170, bool)
    errors = dict(zip(run.refreshes["movements"], run.refreshes["relative_error"], strict=True))
    for movements, error in errors.items():  # each refresh decides until the next
        asked[movements:] = error <= 0.25
    assert told["asked in movements (%)"] == f"{100 * asked.mean():.0f}"
    assert told["asked from movement"] == (str(np.flatnonzero(asked)[0]) if asked.any() else "never")
    assert told["refreshes"] == str(len(errors))
    spent = [run.summary[f"seconds_{part}"] for part in ("model", "physics", "learner", "evaluation")]
    assert told["share of the time (%)"] == f"{100 * spent[0] / sum(spent):.0f}"
    assert "model, seed 2: " in text
    assert "holds no prediction" in text
    alts = [given["alt"] for name, given in Page(text).elements if name == "img"]
    assert [alt for alt in alts if alt.startswith("Forward model")] == ["Forward model of model over time"]
    made_with = [row[0] for row in rows_of(text, "What made the runs")]
    assert {"torch", "lightning", "safetensors"} < set(made_with)
    assert "different versions of torch" not in text


def test_the_figure_of_a_model_is_shaded_where_it_was_not_asked(modelled):
    life, figure = read_life(modelled / "model" / "seed-000"), Figure()
    model.over_time.__wrapped__(figure, life)
    asked = model_run(life).asked
    assert not asked[:50].any()  # it has not learnt yet
    for ax in figure.axes:
        assert max(ax.get_xlim()) < 200
        (shade,) = (each for each in ax.collections if isinstance(each, PolyCollection))
        spans = [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in shade.get_paths()]
        covered = [any(low <= k <= high for low, high in spans) for k in range(170)]
        assert covered[0]
        assert sum(covered) == pytest.approx((~asked).sum(), abs=len(spans))


def test_one_outlier_neither_shrinks_a_map_nor_is_lost(runs):
    life = read_life(runs / "sgim-d" / "seed-003")
    landed = life.outcomes.copy()
    row = np.flatnonzero(np.isfinite(landed).all(axis=1))[3]
    landed[row] = [400.0, 0.3]
    far = Variant("far", [dataclasses.replace(life, outcomes=landed)])
    planes = figures.planes_of([Variant("sgim-d", [life]), far])
    assert (planes["fishing-rod", 2].sides < 4).all()
    figure = Figure()
    figures.landing.__wrapped__(figure, far.landed, np.empty((0, 2)), planes["fishing-rod", 2])
    assert np.ptp(figure.axes[0].get_xlim()) < 4
    squares = figure.axes[0].collections[1].get_offsets()
    assert squares[:, 0].max() == planes["fishing-rod", 2].high[0]


def test_board_and_report_show_the_same_demonstrated_outcomes(tmp_path, go, monkeypatch):
    """Few demonstrations, each shown several times."""
    outcomes, path = [], tmp_path / "few.npz"
    save_demonstrations(path, load_demonstrations()[:3])
    drawn = pictures.landing_points
    monkeypatch.setattr(pictures, "landing_points", lambda ax, *a, **k: (drawn(ax, *a, **k), outcomes.append(ax))[0])
    assert go(tmp_path, "--teacher.every", 10, "--demonstrations", path, "--board", "true") == 0
    run = tmp_path / "sgim-d" / "seed-003"
    on_board = outcomes[-1].lines[0]
    life, figure = read_life(run), Figure()
    assert len(life.shown) > 3
    shown, missing = demonstrated([life])
    assert missing == ""
    (plane,) = figures.planes_of([Variant("sgim-d", [life])]).values()
    figures.landing.__wrapped__(figure, life.landed, shown, plane)
    in_report = figure.axes[0].lines[0]
    assert on_board.get_label() == in_report.get_label() == "3 demonstrated outcomes"
    assert {*map(tuple, on_board.get_xydata())} == {*map(tuple, in_report.get_xydata())}
    lived = dict(
        zip(*rows_of(pages_of.page(run, [Variant("sgim-d", [life])], []), "Where movements came"), strict=True)
    )
    assert lived["of them different"] == "3"
