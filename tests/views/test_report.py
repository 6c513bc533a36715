"""The report: one file that shows what the files of runs hold, for one run or many, finished or not."""

import base64
import io
import json
import re
import shlex
import shutil
import signal
from dataclasses import replace

import numpy as np
import pytest
from markupsafe import escape
from matplotlib.figure import Figure
from PIL import Image

from pages import Page, rows_of
from runs import start
from sgimd_torch.figures.learning import NAMES
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.log import Columns
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.tables import sealed
from sgimd_torch.spaces import Episode, Move
from sgimd_torch.views.report import command as report
from sgimd_torch.views.report import figures
from sgimd_torch.views.report import page as pages_of
from sgimd_torch.views.report.comparison import Comparison, compare
from sgimd_torch.views.report.data import Variant, read_life
from sgimd_torch.views.report.record import AGAIN, doubts
from sgimd_torch.views.statistics import Interval, interquartile_mean

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
def pages(runs, tmp_path_factory):
    """Of all runs, and of one."""
    out = tmp_path_factory.mktemp("pages")
    assert report.main([str(runs), "--out", str(out / "many.html")]) == 0
    assert report.main([str(runs / "sgim-d" / "seed-003"), "--out", str(out / "one.html")]) == 0
    return {name: (out / f"{name}.html").read_text(encoding="utf-8") for name in ("many", "one")}


@pytest.fixture
def copy(runs, tmp_path):
    return shutil.copytree(runs, tmp_path / "runs")


@pytest.mark.parametrize("name", ["many", "one"])
def test_a_page_is_one_file_that_asks_for_nothing_else(pages, name):
    page = Page(pages[name])
    addresses = [given[key] for _, given in page.elements for key in ("src", "href", "poster") if key in given]
    assert addresses
    assert all(address.startswith(("data:", "#")) for address in addresses)
    text = re.sub(r"base64,[A-Za-z0-9+/=]*", "", pages[name])
    assert not re.search(r"https?:|file:|url\(|@import|<script|<object|<iframe", text)
    ids = [given["id"] for _, given in page.elements if "id" in given]
    assert len(ids) == len(set(ids))
    assert {address[1:] for address in addresses if address.startswith("#")} <= set(ids)
    assert ("html", {"lang": "en"}) in page.elements


def test_every_image_has_words_for_those_who_do_not_see_it(pages):
    images = [given for name, given in Page(pages["many"]).elements if name == "img"]
    # all curves, differences; each variant its curve; where the float landed of those that move; two maps of one
    assert len(images) == 2 + 3 + 2 + 2
    assert all(given["alt"] for given in images)


def test_a_page_without_a_model_has_no_section_of_one(pages):
    assert "forward model" not in pages["many"].lower()


def test_every_table_scrolls_by_itself_so_that_a_narrow_page_reaches_each_column(pages):
    style = pages["many"][pages["many"].index("<style>") : pages["many"].index("</style>")]
    assert re.search(r"\.scroll \{[^}]*overflow-x: auto", style)
    assert not re.search(r"(html|body|main) \{[^}]*overflow", style)
    scrolled = [given for name, given in Page(pages["many"]).elements if given.get("class") == "scroll"]
    assert len(scrolled) == len([name for name, _ in Page(pages["many"]).elements if name == "table"])
    assert all(given["tabindex"] == "0" for given in scrolled)  # also by the keys


def test_names_are_text_and_never_markup(pages):
    page = Page(pages["many"])
    assert ODD in page.all("h2")
    assert not [given for name, given in page.elements if name == "b"]
    assert f"Error curve of {ODD}" in [given.get("alt") for _, given in page.elements]


def test_whatever_runs_say_is_text_and_never_markup(copy):
    """In options and their names, versions and their names, the commit, the path of a run and of a film."""
    bad = "\"'><script>alert(1)</script>{{ 7 * 7 }}\ud800"
    (copy / "sgim-d").rename(copy / "<img src=x onerror=alert(1)>")
    run = copy / "<img src=x onerror=alert(1)>" / "seed-003"
    for name, of in (("config", ("goals", "environment", "algorithm")), ("versions", ("commit", "numpy", "before"))):
        content = json.loads((run / f"{name}.json").read_text())
        (run / f"{name}.json").write_text(json.dumps({**content, **dict.fromkeys(of, bad), bad: bad}))
    (run / "<b onclick=f()>.mp4").write_bytes(b"not a film")
    (run.parent / "seed-<u>").mkdir()
    assert report.main([str(copy)]) == 0
    assert report.main([str(run)]) == 0
    for text in ((path / "report.html").read_text(encoding="utf-8") for path in (copy, run)):
        page = Page(text)
        assert not {"script", "b", "u"} & {name for name, _ in page.elements}
        assert all(given["src"].startswith("data:") for name, given in page.elements if name == "img")
        assert not [key for _, given in page.elements for key in given if key.startswith("on")]
        assert bad.replace("\ud800", "\\ud800") in page.all("td") + page.all("th")
        assert "49" not in page.all("td")


def test_the_numbers_of_a_run_are_those_of_its_evaluations(pages, runs):
    run = read_run(runs / "sgim-d" / "seed-003")
    rows = list(zip(*run.evaluation.values(), strict=True))
    assert len(rows) == 2
    evaluations = rows_of(pages["one"], "Every evaluation: distances to the benchmark's goals")
    assert evaluations[1:] == [[f"{row[0]:.0f}", *(f"{value:.4f}" for value in row[1:-1])] for row in rows]
    mean, floor = run.evaluation["mean_error_m"][-1], run.evaluation["noise_floor_m"][-1]
    assert f"lands {mean:.3f} m from a goal" in pages["one"]
    errors = dict(zip(*rows_of(pages["one"], "Errors"), strict=True))
    assert errors["times the floor"] == f"{mean / floor:.2f}"
    area = (run.evaluation["mean_error_m"][0] + mean) / 2  # of one trapezoid
    assert errors["error over life (m)"] == f"{area:.3f}"
    lived = dict(zip(*rows_of(pages["one"], "Where movements came from"), strict=True))
    assert lived["movements"] == "60"
    assert lived["local (%)"] == f"{100 * np.mean(run.origin == 'local'):.1f}"
    assert lived["demonstrations shown"] == str((run.demonstration >= 0).sum())
    assert lived["physics (s)"] == f"{run.summary['seconds_physics']:.1f}"


def test_the_numbers_of_a_variant_are_interquartile_means_over_its_seeds(pages, runs):
    page = Page(pages["many"])
    evaluations = [read_run(runs / "sgim-d" / f"seed-00{seed}").evaluation for seed in (3, 4)]
    errors = np.array([evaluation["mean_error_m"][-1] for evaluation in evaluations])
    floors = np.array([evaluation["noise_floor_m"][-1] for evaluation in evaluations])
    cells = page.all("td")
    assert "error after 1000 (m)" in page.all("th")
    assert f"{interquartile_mean(errors):.3f}" in cells
    assert f"{errors.mean() / floors.mean():.2f}" in cells
    assert all(f"{error:.4f}" in cells for error in errors)


def test_what_a_configuration_names_is_not_executed(copy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hostile.py").write_text("open('was-here', 'w')\n")
    run = copy / "sgim-d" / "seed-003"
    config = json.loads((run / "config.json").read_text())
    own = dict.fromkeys(("environment", "goals", "algorithm", "search", "inverse"), "hostile:make")
    (run / "config.json").write_text(json.dumps({**config, **own}))
    assert report.main([str(run)]) == 0
    assert not (tmp_path / "was-here").exists()
    assert "they are not known without running hostile:make" in (run / "report.html").read_text()


def test_differences_are_those_to_the_baseline_that_was_chosen(runs, pages, tmp_path, capsys):
    out = tmp_path / "page.html"
    assert report.main([str(runs), "--baseline", ODD, "--out", str(out)]) == 0
    captions = [f"Last error minus that of {escape(name)}, paired" for name in ("SGIM-D", ODD)]
    assert [caption in pages["many"] for caption in captions] == [True, False]
    assert [caption in out.read_text() for caption in captions] == [False, True]
    out.unlink()
    assert command(report.main, [str(runs), "--baseline", "observtion", "--out", str(out)]) == 2
    assert "did you mean observation?" in capsys.readouterr().err
    assert not out.exists()


def test_only_options_that_differ_are_compared(pages):
    start = pages["many"].index('id="configurations"')
    table = Page(pages["many"][start - 4 : pages["many"].index('id="versions"') - 4]).all("th")
    assert {"algorithm", "goals", "every", "repeats"} <= set(table)
    assert not {"seed", "out", "name", "noise", "movements"} & set(table)


def test_the_commands_make_the_same_runs_again(pages, runs):
    lines = [code for code in Page(pages["many"]).all("code") if "sgimd run" in code]
    assert len(lines) == 3
    for line in lines:
        words = shlex.split(line[line.index("sgimd ") :].replace("\ndone", "").replace("$seed", "3"))
        config, _ = parse(words[2:])
        assert str(config.out) == AGAIN
        recorded = read_run(runs / config.variant / "seed-003").config
        again = json.loads(json.dumps(config.settings, default=str))
        ignored = ("out", "name", "demonstrations_crc32", "benchmark_crc32")
        assert {k: v for k, v in again.items() if k not in ignored} == {
            k: v for k, v in recorded.items() if k not in ignored
        }
    assert any("--evaluate-at=" in line for line in lines)
    assert sum("for seed in 3 4; do" in line for line in lines) == 2


def test_the_same_runs_give_the_same_page(runs, pages, tmp_path):
    assert report.main([str(runs / "sgim-d" / "seed-003"), "--out", str(tmp_path / "again.html")]) == 0
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == pages["one"]


def test_unfinished_runs_are_counted_and_damaged_ones_named_and_left_out(copy, capsys):
    torn = copy / "sgim-d" / "seed-004"
    lines = (torn / "episodes.csv").read_bytes().splitlines(keepends=True)
    (torn / "episodes.csv").write_bytes(b"".join(lines[:26]) + lines[26][:9])
    assert read_run(torn).damage == {}  # a line without its end is still being written
    (copy / ODD / "seed-003" / "config.json").write_text("{")
    (copy / ODD / "seed-005").mkdir()
    assert report.main([str(copy)]) == 0
    text = (copy / "report.html").read_text(encoding="utf-8")
    assert "1 run not finished" in text
    assert "SGIM-D, seed 4: 25 of 60 movements" in text
    error = read_run(copy / "sgim-d" / "seed-003").evaluation["mean_error_m"][-1]
    assert "1 of 2" in Page(text).all("td")
    assert f"{error:.3f}" in Page(text).all("td")  # of the finished seed alone, so without an interval
    said = capsys.readouterr().err
    for name in ("seed-003", "seed-005"):
        assert f"left out, damaged: {copy / ODD / name}" in said
    assert text.count("Left out, damaged: ") == 2


def test_a_run_whose_log_is_damaged_in_the_middle_is_called_so_and_its_errors_are_left_out(copy):
    run = copy / "sgim-d" / "seed-004"
    lines = (run / "episodes.csv").read_bytes().splitlines(keepends=True)
    lines[26] = lines[26].replace(b",", b";", 1)
    (run / "episodes.csv").write_bytes(b"".join(lines))
    assert read_run(run).damage == {"episodes.csv": 27}  # the names of the columns are line 1
    assert report.main([str(copy)]) == 0
    text = (copy / "report.html").read_text(encoding="utf-8")
    assert "SGIM-D, seed 4: episodes.csv is damaged at line 27; its errors are left out" in text
    assert "not finished" not in text
    good = read_run(copy / "sgim-d" / "seed-003")
    row = next(row for row in rows_of(text, "Errors") if row[0] == "SGIM-D")
    assert row[1].split() == ["1", "of", "2"]
    assert row[4] == f"{good.evaluation['mean_error_m'][-1]:.3f}"  # of one seed, so without an interval
    lived = next(row for row in rows_of(text, "Where movements came from") if row[0] == "SGIM-D")
    assert lived[1] == "60"
    states = [row[2] for row in rows_of(text, "Every run of SGIM-D")[1:]]
    assert states == ["finished", "episodes.csv is damaged at line 27"]


def test_a_damaged_run_alone_has_no_last_error(copy):
    run = copy / "sgim-d" / "seed-004"
    lines = (run / "episodes.csv").read_bytes().splitlines(keepends=True)
    (run / "episodes.csv").write_bytes(b"".join([*lines[:26], b"\n", *lines[27:]]))
    assert report.main([str(run)]) == 0
    text = (run / "report.html").read_text(encoding="utf-8")
    assert "25 of 60 movements on fishing-rod, episodes.csv is damaged at line 27" in text
    assert rows_of(text, "Errors")[1][4] == "–"
    assert "m from a goal" not in text


@pytest.mark.parametrize("dim", [1, 3])
def test_outcomes_that_are_not_in_the_plane_have_maps_of_strips_or_pairs(copy, dim):
    path = copy / "sgim-d" / "seed-003"
    run, rng = read_run(path), np.random.default_rng(0)
    columns = Columns(0, 2, dim)
    lines = [columns.header]
    for index, origin in enumerate(run.origin):
        theta, goal, outcome = rng.random(2), rng.random(dim), rng.random(dim)
        move = Move(theta, goal=goal, origin=str(origin)) if origin else None
        lines.append(columns.line(Episode(index, np.empty(0), move, outcome if origin else None, None), None))
    (path / "episodes.csv").write_bytes(b"".join(lines))
    corners = {1: "0.0,0.0,1.0,1.0", 3: "0.0,0.0,0.0,1.0,1.0,1.0"}[dim]  # of one outcome, with a context
    names = [f"{end}_{k}" for end in ("low", "high") for k in range({1: 2, 3: 3}[dim])]
    head = ",".join(["movements", "path", *names, "attempts", "goals", "competence", "interest"])
    (path / "regions.csv").write_text(f"{head}\n60,R,{corners},3,3,-0.5,0.1\n")
    life = read_life(path)
    assert len(life.index) == len(life.regions["movements"]) * 60 == 60
    assert report.main([str(copy)]) == 0  # next to a seed in the plane
    shutil.rmtree(copy / "sgim-d" / "seed-004")
    for place in (path, copy):
        assert report.main([str(place)]) == 0
        text = (place / "report.html").read_text(encoding="utf-8")
        assert f"Its outcomes have {dim} dimension" in text
        assert f"{run.evaluation['mean_error_m'][-1]:.4f}" in Page(text).all("td")
    alts = [given["alt"] for name, given in Page((path / "report.html").read_text()).elements if name == "img"]
    assert alts == [
        *("Error curve of SGIM-D", "Landing points of SGIM-D"),
        *("Interest map of SGIM-D", "Interest maps over time of SGIM-D"),
    ]


def test_names_may_be_more_and_in_any_order(copy, monkeypatch):
    """Such as a new algorithm in the tables, which has no colour of its own yet."""
    (copy / "sgim-d").rename(copy / "sixth")
    assert report.main([str(copy)]) == 0
    before = (copy / "report.html").read_text(encoding="utf-8")
    known = dict(NAMES)
    for name in known:
        monkeypatch.delitem(NAMES, name)
    for name, label in [("other", "Other"), *reversed(known.items()), ("sixth", "The sixth")]:
        monkeypatch.setitem(NAMES, name, label)
    assert report.main([str(copy)]) == 0
    after = (copy / "report.html").read_text(encoding="utf-8")
    assert rows_of(after, "Errors") == [
        [cell.replace("sixth", "The sixth") for cell in row] for row in rows_of(before, "Errors")
    ]
    assert "The sixth" in Page(after).all("h2")
    monkeypatch.setitem(NAMES, "sixth", "")  # as of an entry of the catalogue that says nothing of figures
    assert Variant("sixth", [read_life(copy / "sixth" / "seed-003")]).label == "sixth"


def test_algorithms_without_a_colour_of_their_own_can_be_told_apart(copy):
    lives = []
    for algorithm in ("sixth", "seventh"):
        path = shutil.copytree(copy / "sgim-d" / "seed-003", copy / algorithm / "seed-003")
        config = json.loads((path / "config.json").read_text())
        (path / "config.json").write_text(json.dumps({**config, "algorithm": algorithm}))
        lives.append(read_life(path))
    figure = Figure()
    variants = [Variant(life.config["algorithm"], [life]) for life in lives]
    figures.curves.__wrapped__(figure, variants, figures.colours_of(variants))
    one, other = figure.axes[0].lines
    assert one.get_color() != other.get_color()
    figures.curves.__wrapped__(again := Figure(), variants, {"sixth": "red", "seventh": "red"})
    one, other = again.axes[0].lines
    assert one.get_linestyle() != other.get_linestyle()


def test_a_variant_alone_shows_each_of_its_seeds_and_several_only_their_means(runs):
    lives = [read_life(runs / "sgim-d" / f"seed-00{seed}") for seed in (3, 4)]
    variant, alone, beside = Variant("sgim-d", lives), Figure(), Figure()
    colours = {"sgim-d": "red", "uniform": "blue"}
    figures.curves.__wrapped__(alone, [variant], colours)
    figures.curves.__wrapped__(beside, [variant, Variant("uniform", lives)], colours)
    drawn = [line.get_ydata().tolist() for line in alone.axes[0].lines]
    assert all(errors in drawn for errors in variant.errors.tolist())
    assert [line.get_ydata().tolist() for line in beside.axes[0].lines] == 2 * [variant.curve[0].tolist()]


def test_variants_behind_a_curve_do_not_stretch_its_axis(runs):
    life = read_life(runs / "sgim-d" / "seed-003")
    figure, variant, longer = Figure(), Variant("sgim-d", [life]), Variant("uniform", [life])
    longer.evaluated = 100 * longer.evaluated
    figures.curves.__wrapped__(figure, [variant], {"sgim-d": "red"}, behind=[longer])
    assert 60 <= figure.axes[0].get_xlim()[1] < 70  # movements; the other went on to 6000


@pytest.mark.parametrize(("moments", "rows", "columns"), [(1, 1, 1), (2, 1, 2), (3, 2, 2), (4, 2, 2), (9, 2, 2)])
def test_at_most_four_maps_of_a_run_are_shown_in_rows_of_two(runs, moments, rows, columns):
    life, figure = read_life(runs / "sgim-d" / "seed-003"), Figure()
    last = life.regions["movements"] == 60
    once = {name: column[last] for name, column in life.regions.items()}
    regions = {name: np.tile(column, moments) for name, column in once.items()}
    regions["movements"] = np.repeat(100 * np.arange(1, moments + 1), last.sum())
    figures.splitting.__wrapped__(figure, replace(life, regions=regions))
    maps = [ax for ax in figure.axes if ax.get_title()]
    assert len(maps) == min(moments, 4)
    assert {ax.get_subplotspec().get_geometry()[:2] for ax in maps} == {(rows, columns)}


def test_the_rows_of_a_figure_of_differences_are_two_or_three_lines_of_text_high(runs):
    variant, heights = Variant("sgim-d", [read_life(runs / "sgim-d" / "seed-003")]), []
    for n in (2, 7):
        figure = Figure()
        compared = [Comparison(variant, np.array([0.1, 0.2]), Interval(0.15, 0.1, 0.2)) for _ in range(n)]
        figures.differences.__wrapped__(figure, compared, variant)
        heights.append(72 * figure.get_size_inches()[1])  # points
    line = 1.2 * figures.STYLE["font.size"]
    assert 1.5 * line < (heights[1] - heights[0]) / 5 < 3 * line


def test_a_variant_is_not_compared_with_itself(runs):
    lives = [read_life(runs / "sgim-d" / f"seed-00{seed}") for seed in (3, 4)]
    baseline, other = Variant("sgim-d", lives), Variant("again", lives)
    assert [each.variant for each in compare([baseline, other], baseline)] == [other]


def test_no_picture_of_a_page_can_be_packed_smaller(pages):
    source = next(given["src"] for name, given in Page(pages["one"]).elements if name == "img")
    content, again = base64.b64decode(source.partition(",")[2]), io.BytesIO()
    with Image.open(io.BytesIO(content)) as picture:
        picture.save(again, "png", optimize=True)
    assert len(content) <= len(again.getvalue())


def test_of_options_that_differ_only_values_that_most_variants_share_are_pale(pages, copy):
    def marked(text):
        return re.findall(
            '<td class="(.*?)">', text[text.index("Only options in which runs differ") :].partition("</tbody>")[0]
        )

    assert set(marked(pages["many"])) == {"usual", "other"}  # three variants
    shutil.rmtree(copy / "observation")
    assert report.main([str(copy)]) == 0
    assert set(marked((copy / "report.html").read_text(encoding="utf-8"))) == {"other"}  # no two of two agree


def test_options_that_this_version_lacks_are_named_beside_the_command(pages, copy):
    assert "does not have" not in pages["one"]
    path = copy / "sgim-d" / "seed-003" / "config.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "boredom": 3}))
    assert report.main([str(path.parent)]) == 0
    assert "this version does not have are missing here: boredom." in (path.parent / "report.html").read_text()


def test_without_motor_noise_nothing_is_divided_by_the_floor(copy):
    run = copy / "observation" / "seed-003"
    header, *lines = (run / "evaluation.csv").read_bytes().splitlines(keepends=True)
    fields = [line.decode().split(",") for line in lines]  # the last ones: noise floor, goals met, checksum
    rows = [sealed([*errors, "1e-16", met]) for *errors, _, met, _ in fields]
    (run / "evaluation.csv").write_bytes(b"".join([header, *rows]))
    assert report.main([str(run)]) == 0
    errors = dict(zip(*rows_of((run / "report.html").read_text(), "Errors"), strict=True))
    assert errors["noise floor (m)"] == "0.000"
    assert errors["times the floor"] == "–"


def test_a_run_that_has_hardly_begun_is_reported(copy):
    run = copy / "observation" / "seed-003"
    (run / "episodes.csv").write_text("")
    for name in ("summary.json", "versions.json", "evaluation.csv"):
        (run / name).unlink()
    assert report.main([str(run)]) == 0
    text = (run / "report.html").read_text(encoding="utf-8")
    assert "0 of 60 movements" in text
    assert "never evaluated" in text


@pytest.mark.parametrize(
    ("commits", "warning"),
    [
        (["a" * 40, "b" * 40], "different versions of commit: aaa"),
        (["a" * 40 + "-dirty"] * 2, "2 runs came from a checkout with uncommitted changes"),
        ([None, None], "The commit of 2 runs is not known"),
        (["a" * 40] * 2, ""),
    ],
)
def test_doubtful_versions_are_reported(copy, commits, warning):
    lives = []
    for seed, commit in zip((3, 4), commits, strict=True):
        path = copy / "sgim-d" / f"seed-00{seed}"
        versions = json.loads((path / "versions.json").read_text())
        (path / "versions.json").write_text(json.dumps({**versions, "commit": commit}))
        lives.append(read_life(path))
    said = list(doubts([Variant("sgim-d", lives)]))
    assert len(said) == bool(warning)
    assert warning in "".join(said)


def test_doubts_stand_above_the_results_and_the_commit_by_the_commands(copy):
    run = copy / "observation" / "seed-003"
    versions = json.loads((run / "versions.json").read_text())
    for commit in ("c" * 40, "c" * 40 + "-dirty"):
        (run / "versions.json").write_text(json.dumps({**versions, "commit": commit}))
        assert report.main([str(run)]) == 0
        text = (run / "report.html").read_text(encoding="utf-8")
        assert ("uncommitted changes" in text[: text.index('id="results"')]) == commit.endswith("-dirty")
        assert ("git checkout" in text) != commit.endswith("-dirty")


def test_a_film_beside_a_run_is_kept_in_the_page_and_one_that_is_too_large_is_named(copy, monkeypatch):
    run = copy / "observation" / "seed-003"
    film = copy / "observation" / "seed-003.mp4"
    assert pages_of.find_films(run) == []
    film.write_bytes(b"not a film")  # which nothing can decode: then it has no still
    (copy / "observation" / "seed-0030.mp4").write_bytes(b"of another run")
    assert pages_of.find_films(run) == [film]
    assert report.main([str(run)]) == 0
    videos = [given for name, given in Page((run / "report.html").read_text()).elements if name == "video"]
    assert [video["src"] for video in videos] == ["data:video/mp4;base64,bm90IGEgZmlsbQ=="]
    assert "controls" in videos[0]
    assert "poster" not in videos[0]
    film.write_bytes(bytes(pages_of.MOST + 1))
    assert report.main([str(run)]) == 0
    text = (run / "report.html").read_text()
    assert "<video" not in text
    assert "too large for this page (3.0 MB)" in text


def test_without_a_film_the_page_says_how_to_make_one(pages, runs):
    assert shlex.join(["sgimd", "film", str(runs / "sgim-d" / "seed-003")]) in pages["one"]


@pytest.mark.parametrize("problem", ["missing", "a file", "empty", "all damaged", "out is a folder", "no such folder"])
def test_what_cannot_be_reported_ends_with_one_line_and_nothing_written(copy, tmp_path, capsys, problem):
    place, out, wanted = copy, tmp_path / "page.html", ""
    if problem == "missing":
        place, wanted = tmp_path / "nowhere", "does not exist"
    elif problem == "a file":
        place, wanted = copy / "sgim-d" / "seed-003" / "config.json", "is a file, not a folder"
    elif problem == "empty":
        place, wanted = copy / "sgim-d" / "seed-003" / "films", "holds no runs"
        place.mkdir()
    elif problem == "all damaged":
        place, wanted = copy / "observation" / "seed-003", "no run can be read"
        (place / "config.json").write_text('{"algorithm": 3}')
    elif problem == "out is a folder":
        out, wanted = tmp_path, "is a folder"
    else:
        out, wanted = tmp_path / "no" / "page.html", "folder that exists"
    before = sorted(tmp_path.rglob("*"))
    assert command(report.main, [str(place), "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert wanted in said.err
    assert said.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_an_interrupted_report_leaves_nothing(copy):
    program = (
        "import os, signal, sys\nfrom sgimd_torch.runs import process\n"
        "from sgimd_torch.views.report import command, figures\ndraw = figures.one_curve\n"
        "def one_curve(*a):\n    os.kill(os.getpid(), signal.SIGINT); return draw(*a)\n"
        "figures.one_curve = one_curve; sys.exit(process.command(command.main, sys.argv[1:]))"
    )
    process = start(program, copy / "observation")
    _, said = process.communicate()
    assert process.returncode == 128 + signal.SIGINT
    assert said == "stopped; no page was written\n"
    assert not list((copy / "observation").glob("report*"))
