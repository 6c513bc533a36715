"""The report: one file that shows what runs have recorded, for one run or many, finished or not."""

import base64
import io
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from markupsafe import escape
from matplotlib.figure import Figure
from PIL import Image

from pages import Page, alts, drawn, rows_of
from sgimd_torch.extras.report import command as report
from sgimd_torch.extras.report import figures, provenance
from sgimd_torch.extras.report.command import page
from sgimd_torch.extras.table.names import COLOURS
from sgimd_torch.extras.table.statistics import interquartile_mean
from sgimd_torch.extras.table.variants import Variant, best_first
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Box

FIGURES = [f"{what} of SGIM-D" for what in ("Error curve", "Landing points", "Misses", "Expected misses", "Regions")]
ODD = "<b>&'$x\" "


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    """Two seeds with an interest map, a variant of theirs with a dangerous name, one that only watches."""
    out = tmp_path_factory.mktemp("runs")
    short = ("--movements", 60, "--evaluate_at", 30)
    for seed in (3, 4):
        assert go(out, *short, "--seed", seed) == 0
        assert go(out, *short, "--seed", seed, "--name", ODD, "--goals", "uniform", "--teacher.every", 10) == 0
    assert go(out, *short, "--algorithm", "observation", "--repeats", 0) == 0
    return out


@pytest.fixture(scope="module")
def run(runs):
    return read_run(runs / "sgim-d" / "seed-003")


@pytest.fixture(scope="module")
def pages(runs, tmp_path_factory):
    """Of all runs, and of one."""
    out = tmp_path_factory.mktemp("pages")
    assert report.main([str(runs), "--out", str(out / "many.html")]) == 0
    assert report.main([str(runs / "sgim-d" / "seed-003"), "--out", str(out / "one.html")]) == 0
    return {name: (out / f"{name}.html").read_text(encoding="utf-8") for name in ("many", "one")}


@pytest.mark.parametrize("name", ["many", "one"])
def test_a_page_is_one_file_that_asks_for_nothing_else(pages, name):
    elements = Page(pages[name]).elements
    addresses = [given[key] for _, given in elements for key in ("src", "href", "poster") if key in given]
    assert addresses
    assert all(address.startswith(("data:", "#")) for address in addresses)
    text = re.sub(r"base64,[A-Za-z0-9+/=]*", "", pages[name])
    assert not re.search(r"https?:|file:|url\(|@import|<script|<object|<iframe", text)
    ids = [given["id"] for _, given in elements if "id" in given]
    assert len(ids) == len(set(ids))
    assert {address[1:] for address in addresses if address.startswith("#")} <= set(ids)


def test_every_figure_is_an_image_with_words_for_those_who_do_not_see_it(pages):
    assert alts(pages["one"]) == FIGURES
    # all curves; of each variant its curve and misses, where it landed if it moved, expected misses if it knew, regions
    assert len(alts(pages["many"])) == 1 + 3 + 3 + 2 + 2 + 1
    assert all(alts(pages["many"]))
    source = next(given["src"] for name, given in Page(pages["one"]).elements if name == "img")
    with Image.open(io.BytesIO(base64.b64decode(source.partition(",")[2]))) as picture:
        assert min(picture.size) >= 400


def test_whatever_runs_say_is_text_and_never_markup_a_formula_or_a_control_character(pages, run, tmp_path):
    """In names, settings, versions, the commit, the path and the words of a run."""
    assert ODD in Page(pages["many"]).all("h2")
    bad = "$\\frac{$\"'><script>alert(1)</script>{{ 7 * 7 }}\ud800"
    space = Box.cube(-1, 1, 2, names=("$\\frac{$", "$x_$"), unit="$\\frac{$")
    wrong = replace(
        run,
        path=tmp_path / bad,
        spaces={**run.spaces, "outcomes": space},
        words=["--name=\x1b[31m", "--algorithm=sgim-d"],
        config={**run.config, "goals": bad, "environment": bad, bad: bad},
        versions={**run.versions, "commit": bad, bad: bad},
        summary={**run.summary, "finished": False},
    )
    made = page(tmp_path / bad, [Variant(bad, [wrong]), Variant("other", [run])])
    elements = Page(made).elements
    assert not {"script", "b", "u"} & {name for name, _ in elements}
    assert all(given["src"].startswith("data:") for name, given in elements if name == "img")
    assert not [key for _, given in elements for key in given if key.startswith("on")]
    assert bad.replace("\ud800", "\\ud800") in Page(made).all("h2")
    assert "49" not in Page(made).all("td")
    assert "\x1b" not in made


def test_the_numbers_of_a_run_are_those_of_its_evaluations(pages, run):
    mean, floor = run.at(60), run.at(60, "noise_floor")
    assert f"lands {mean:.3f} m from a goal after 60 movements" in pages["one"]
    assert "60 of 60 movements on fishing-rod" in pages["one"]
    errors = dict(zip(*rows_of(pages["one"], "Errors"), strict=True))
    assert errors["error (m)"] == f"{mean:.3f}"
    assert errors["median (m)"] == f"{run.at(60, 'median_error'):.3f}"
    assert errors["noise floor (m)"] == f"{floor:.3f}"
    assert errors["physics (ms)"] == f"{1000 * run.summary['seconds_physics'] / 60:.2f}"


def cut_short(run, n, **changes):
    """The run, stopped after ``n`` movements and never evaluated."""
    columns = ("index", "origin", "demonstration", "contexts", "goals", "outcomes", "failed")
    cut = replace(run, **{**{name: getattr(run, name)[:n] for name in columns}, **changes}, regions=None)
    summary = {**run.summary, "movements": n, "failed": int(cut.failed.sum()), "finished": False}
    nothing = {name: column[:0] for name, column in run.evaluations["own"].items()}
    return replace(cut, evaluations={"own": nothing}, summary=summary)


@pytest.mark.usefixtures("undrawn")
def test_a_run_that_has_hardly_begun_is_reported_and_one_that_was_never_evaluated_comes_last(run, tmp_path):
    begun = cut_short(run, 0, demonstrations=[])
    made = page(tmp_path, [Variant("new", [begun])])
    assert "0 of 60 movements" in made
    assert "No run has been evaluated" in made
    assert f"1 run not finished, stopped or still running: {run.path}: 0 of 60 movements" in made
    assert "lands" in page(tmp_path, [Variant("sgim-d", [run]), Variant("new", [begun])])


@pytest.mark.usefixtures("undrawn")
def test_a_run_without_evaluations_is_judged_by_its_own_goals(run, tmp_path):
    goals = np.repeat([[0.0, 0.5], [0.5, 0.0], [0.0, 0.0]], 2, axis=0)  # the nearer of two movements at each counts
    outcomes = goals + np.stack([[0.3, 0.01, 0.2, 0.1, 0.4, np.nan], np.zeros(6)], axis=1)
    told = {"goals": goals, "outcomes": outcomes, "failed": np.arange(6) == 5, "tolerance": 0.02}
    variant = Variant("sgim-d", [cut_short(run, 6, **told, origin=np.array(["local"] * 6))])
    assert variant.own_goals.movements.tolist() == list(range(7))
    assert variant.own_goals.missed[0, 1:] == pytest.approx([0.01, 0.01, 0.055, 0.055, 0.1, 0.1])
    assert variant.own_goals.met[0, 1:] == pytest.approx([1, 1, 1 / 2, 1 / 2, 1 / 3, 1 / 3])
    assert variant.own_goals.failed[0, 1:] == pytest.approx([0] * 5 + [1 / 6])
    made = page(tmp_path, [variant])
    assert "missed the last 50 goals that it chose by 0.100 m (median), and met 33% of them within 0.02 m." in made
    assert alts(made) == ["Own goals of SGIM-D", "Landing points of SGIM-D"]
    head, row = rows_of(made, "Own goals")
    assert dict(zip(head, row, strict=True))["failed"] == "16.7%"
    assert [len(ax.lines) for ax in drawn(figures.own_goals, variant).axes] == [1, 2]


def test_errors_are_those_of_finished_runs_and_unfinished_ones_are_named(runs, run):
    other = read_run(runs / "sgim-d" / "seed-004")
    cut = replace(other, index=other.index[:25], summary={**other.summary, "finished": False})
    variant = Variant("sgim-d", [run, cut])
    assert variant.used == [run]
    assert f"{cut.path}: 25 of 60 movements" in "".join(provenance.warnings([variant]))
    assert Variant("sgim-d", [cut]).used == [cut]  # if there is nothing better


@pytest.mark.parametrize("dim", [1, 3])
def test_outcomes_that_are_not_in_the_plane_have_maps_of_strips_or_pairs(run, tmp_path, dim):
    rng = np.random.default_rng(0)
    corners = {f"low_{k}": np.zeros(1) for k in range(dim)} | {f"high_{k}": np.ones(1) for k in range(dim)}
    about = {"attempts": np.array([3]), "competence": np.array([-0.5]), "interest": np.array([0.1])}
    other = replace(
        run,
        goals=rng.random((60, dim)),
        outcomes=rng.random((60, dim)),
        demonstrations=[],
        regions={"movements": np.array([60]), "path": np.array(["R"]), **corners, **about},
        benchmark=rng.random((3, dim)),
        spaces={**run.spaces, "outcomes": Box.cube(0, 1, dim)},
    )
    made = page(tmp_path, [Variant("sgim-d", [other])])
    assert alts(made) == FIGURES


FIVE = [0.10, 0.12, 0.11, 0.14, 0.10]


def made(run, name, errors):
    """Runs like ``run`` with these last errors (m), one for each seed from 0 on."""
    runs = []
    for seed, error in enumerate(errors):
        own = {**run.evaluations["own"], "mean_error": np.array([0.5, error])}
        runs.append(replace(run, config={**run.config, "seed": seed}, evaluations={**run.evaluations, "own": own}))
    return Variant(name, runs)


@pytest.mark.usefixtures("undrawn")
def test_five_seeds_have_intervals_and_a_verdict_and_four_have_points_and_a_note(run, tmp_path):
    variants = [
        made(run, "sgim-d", FIVE),
        made(run, "worse", [error + 0.1 for error in FIVE]),
        made(run, "alike", FIVE[::-1]),
        made(run, "few", [error + 0.1 for error in FIVE[:4]]),
    ]
    text = page(tmp_path, variants)
    errors = {row[0]: row[3] for row in rows_of(text, "Errors")}
    low, high = map(float, re.search(r"\[(.*), (.*)\]", errors["SGIM-D"]).groups())
    assert min(FIVE) <= low < interquartile_mean(np.array(FIVE)) < high <= max(FIVE)
    assert errors["few"] == f"{interquartile_mean(np.array(FIVE[:4]) + 0.1):.3f}"
    rows = {row[0]: row[1:] for row in rows_of(text, "Last errors minus those of SGIM-D")[1:]}
    assert rows["worse"] == ["5", "+0.100 [+0.100, +0.100]", "worse"]
    assert rows["alike"][2] == "not told apart"
    assert rows["few"] == ["4", "+0.100", "fewer than 5 common seeds"]
    assert "Fewer than 5 seeds: few (4)." in text[: text.index('id="results"')]


def test_variants_of_one_algorithm_have_colours_of_their_own_whatever_their_results(run):
    names = ["b", "a", "sgim-d", "c"]
    colours = figures.colours_of([Variant(name, [run]) for name in names])
    assert colours["sgim-d"] == COLOURS["sgim-d"]
    assert len({*colours.values()}) == len(names)
    assert figures.colours_of([Variant(name, [run]) for name in names[::-1]]) == colours
    assert figures.colours_of([Variant("b", [run])]) == {"b": COLOURS["sgim-d"]}
    assert len(figures.colours_of([Variant(str(k), [run]) for k in range(30)])) == 30


def test_eight_curves_of_one_figure_have_eight_colours(run):
    variants = [Variant(f"{7 * k % 12:02}", [run]) for k in range(12)]  # in another order than their names
    colours = figures.colours_of(variants)
    figure = Figure()
    figures.error_curves(figure, variants[: figures.MOST_CURVES], colours)
    assert len({line.get_color() for line in figure.axes[0].lines}) == 8


def in_unit(run, unit, factor):
    space = run.spaces["outcomes"]
    box = replace(space, low=factor * space.low, high=factor * space.high, unit=unit)
    variant = made(run, unit, factor * np.array(FIVE))
    return Variant(unit, [replace(one, spaces={**one.spaces, "outcomes": box}) for one in variant.runs])


@pytest.mark.usefixtures("undrawn")
def test_errors_in_different_units_have_axes_of_their_own_and_no_verdict(run, tmp_path):
    variants = best_first([in_unit(run, "mm", 1e3), in_unit(run, "m", 1), made(run, "worse", [1.0] * 5)])
    assert [variant.name for variant in variants] == ["m", "worse", "mm"]
    figure = Figure()
    figures.error_curves(figure, variants, figures.colours_of(variants))
    heads = [ax.get_ylabel() for ax in figure.axes]
    assert heads == [f"mean distance to benchmark goals ({unit})" for unit in ("m", "mm")]
    assert [len(ax.lines) for ax in figure.axes] == [2, 1]
    text = page(tmp_path, variants)
    assert [row[0] for row in rows_of(text, "Last errors minus those of m")[1:]] == ["worse"]
    assert "Errors have different units, so they cannot be compared: m, worse in m; mm in mm." in text
    assert "Errors lie between" not in text


@pytest.mark.usefixtures("undrawn")
def test_differences_are_those_to_the_baseline_that_was_chosen(runs, pages, tmp_path):
    out = tmp_path / "page.html"
    assert report.main([str(runs), "--baseline", ODD, "--out", str(out)]) == 0
    captions = [f"Last errors minus those of {escape(name)}, paired" for name in ("SGIM-D", ODD)]
    assert [caption in pages["many"] for caption in captions] == [True, False]
    assert [caption in out.read_text() for caption in captions] == [False, True]


def test_only_settings_that_differ_are_compared(pages):
    (head, *_) = rows_of(pages["many"], "Only settings in which runs differ")
    assert {"algorithm", "goals", "teacher.every", "repeats"} <= set(head)
    assert not {"seed", "out", "name", "environment.noise", "movements"} & set(head)


def test_the_commands_make_the_same_runs_again(pages, runs):
    lines = [code for code in Page(pages["many"]).all("code") if "sgimd run" in code]
    assert len(lines) == 3
    for line in lines:
        words = shlex.split(line[line.index("sgimd ") :].replace("\ndone", "").replace("$seed", "3"))
        config, _ = parse(words[2:])
        assert str(config.out) == provenance.AGAIN
        recorded = read_run(runs / config.variant / "seed-003")
        again = replace(recorded, config=config.settings)
        assert provenance.differing([Variant("again", [recorded, again])]) == {}
    assert sum("for seed in 3 4; do" in line for line in lines) == 2


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        ({}, ""),
        ({"files": {"benchmark_crc32": "0"}}, "different benchmarks, so their errors cannot be compared"),
        ({"config": {"teacher.every": 7}}, "The seeds of SGIM-D have different settings: they differ in teacher.every"),
        ({"versions": {"commit": "a" * 40 + "-dirty"}}, "1 run came from a checkout with uncommitted changes"),
    ],
)
def test_what_makes_a_comparison_doubtful_is_said(run, change, warning):
    clean = replace(run, versions={**run.versions, "commit": "a" * 40})
    other = replace(clean, **{name: {**getattr(clean, name), **values} for name, values in change.items()})
    few, *more = provenance.warnings([Variant("sgim-d", [clean, other])])
    assert "Fewer than 5 seeds" in few
    assert warning in "".join(more)
    assert bool(more) == bool(change)


def test_the_same_runs_give_the_same_page(runs, pages, tmp_path):
    assert report.main([str(runs / "sgim-d" / "seed-003"), "--out", str(tmp_path / "again.html")]) == 0
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == pages["one"]
