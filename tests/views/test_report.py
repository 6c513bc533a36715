"""The report: one file that tells what the runs' own files tell, of one run or of many, whatever became of them."""

import json
import re
import shlex
import shutil
import signal
from html.parser import HTMLParser

import numpy as np
import pytest

from runs import start
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.read import read_run
from sgimd_torch.views.report import command as report
from sgimd_torch.views.report.data import Variant, read_life
from sgimd_torch.views.report.films import find_films
from sgimd_torch.views.report.html import document, tag
from sgimd_torch.views.report.repeat import AGAIN, doubts
from sgimd_torch.views.statistics import interquartile_mean

ODD = "<b>&'$x\" "


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    """Two seeds with an interest map, a variant of theirs with a dangerous name, one that only watches."""
    out = tmp_path_factory.mktemp("runs")
    short = ("--movements", 60, "--evaluate_at", 30)
    for seed in (3, 4):
        assert go(out, *short, "--seed", seed) == 0
        assert go(out, *short, "--seed", seed, "--name", ODD, "--goals", "uniform", "--every", 10) == 0
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


class Page(HTMLParser):
    """The elements with their attributes, and the text of headings, cells and code; refuses what is not closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.texts = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, name, attributes):
        self.elements.append((name, dict(attributes)))
        if name not in ("meta", "link", "img"):
            self.open.append(name)

    def handle_endtag(self, name):
        assert self.open.pop() == name

    def handle_data(self, text):
        self.texts.append((self.open[-1] if self.open else "", text))

    def all(self, name):
        return [text for element, text in self.texts if element == name]


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


def test_names_are_text_and_never_markup(pages):
    page = Page(pages["many"])
    assert ODD in page.all("h2")
    assert not [given for name, given in page.elements if name == "b"]
    assert "&lt;x&gt;" in document("t", [tag("p", "<x>", title='"')])
    assert 'title="&quot;"' in tag("p", title='"')


def test_the_numbers_of_a_run_are_those_of_its_evaluations(pages, runs):
    run = read_run(runs / "sgim-d" / "seed-003")
    cells = Page(pages["one"]).all("td")
    rows = list(zip(*run.evaluation.values(), strict=True))
    assert len(rows) == 2
    assert cells[:8] == [f"{value:.4f}" for row in rows for value in row[1:]]
    mean, floor = run.evaluation["mean_error_m"][-1], run.evaluation["noise_floor_m"][-1]
    assert f"lands {mean:.3f} m from a goal" in pages["one"]
    assert f"{mean / floor:.2f} times the noise floor" in pages["one"]
    local = np.mean(run.origin == "local")
    assert f"{100 * local:.1f} % local" in pages["one"]


def test_the_numbers_of_a_variant_are_interquartile_means_over_its_seeds(pages, runs):
    page = Page(pages["many"])
    evaluations = [read_run(runs / "sgim-d" / f"seed-00{seed}").evaluation for seed in (3, 4)]
    errors = np.array([evaluation["mean_error_m"][-1] for evaluation in evaluations])
    floors = np.array([evaluation["noise_floor_m"][-1] for evaluation in evaluations])
    cells = page.all("td")
    # the interval of two seeds reaches from one to the other
    assert f"{interquartile_mean(errors):.3f} [{errors.min():.3f}, {errors.max():.3f}]" in cells
    assert any(cell.startswith(f"{errors.mean() / floors.mean():.2f} [") for cell in cells)
    assert all(f"{error:.4f}" in cells for error in errors)


def test_only_options_that_differ_are_compared(pages):
    start = pages["many"].index('id="configurations"')
    table = Page(pages["many"][start - 4 : pages["many"].index('id="versions"') - 4]).all("th")
    assert {"algorithm", "goals", "every", "repeats"} <= set(table)
    assert not {"seed", "out", "name", "noise", "movements"} & set(table)


def test_the_commands_make_the_same_runs_again(pages, runs):
    lines = [code for code in Page(pages["many"]).all("code") if "experiments/run.py" in code]
    assert len(lines) == 3
    for line in lines:
        words = shlex.split(line[line.index("python ") :].replace("\ndone", "").replace("$seed", "3"))
        config, _ = parse(words[2:])
        assert str(config.out) == AGAIN
        recorded = read_run(runs / config.variant / "seed-003").config
        again = json.loads(json.dumps(vars(config), default=str))
        ignored = ("out", "name", "demonstrations_crc32", "benchmark_crc32")
        assert {k: v for k, v in again.items() if k not in ignored} == {
            k: v for k, v in recorded.items() if k not in ignored
        }
    assert sum("for seed in 3 4; do" in line for line in lines) == 2


def test_the_same_runs_give_the_same_page(runs, pages, tmp_path):
    assert report.main([str(runs / "sgim-d" / "seed-003"), "--out", str(tmp_path / "again.html")]) == 0
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == pages["one"]


def test_unfinished_runs_are_counted_and_damaged_ones_named_and_left_out(copy, capsys):
    torn = copy / "sgim-d" / "seed-004"
    lines = (torn / "episodes.csv").read_bytes().splitlines(keepends=True)
    (torn / "episodes.csv").write_bytes(b"".join(lines[:26]) + lines[26][:9])
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


def test_a_run_that_has_hardly_begun_is_told_of(copy):
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
def test_doubtful_versions_are_told(copy, commits, warning):
    lives = []
    for seed, commit in zip((3, 4), commits, strict=True):
        path = copy / "sgim-d" / f"seed-00{seed}"
        versions = json.loads((path / "versions.json").read_text())
        (path / "versions.json").write_text(json.dumps({**versions, "commit": commit}))
        lives.append(read_life(path))
    said = doubts([Variant("sgim-d", lives)])
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
    assert find_films(run) == []
    film.write_bytes(b"not a film")  # which nothing can decode: then it has no still
    (copy / "observation" / "seed-0030.mp4").write_bytes(b"of another run")
    assert find_films(run) == [film]
    assert report.main([str(run)]) == 0
    videos = [given for name, given in Page((run / "report.html").read_text()).elements if name == "video"]
    assert [video["src"] for video in videos] == ["data:video/mp4;base64,bm90IGEgZmlsbQ=="]
    assert "controls" in videos[0]
    assert "poster" not in videos[0]
    film.write_bytes(bytes(report.MOST + 1))
    assert report.main([str(run)]) == 0
    text = (run / "report.html").read_text()
    assert "<video" not in text
    assert "too large for this page (3.0 MB)" in text


def test_without_a_film_the_page_says_how_to_make_one(pages, runs):
    assert shlex.join(["scripts/film", str(runs / "sgim-d" / "seed-003")]) in pages["one"]


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
    assert report.main([str(place), "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert wanted in said.err
    assert said.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_an_interrupted_report_leaves_nothing(copy):
    program = "import report, report_page, os, signal, sys\n" + (
        "draw = report.section\n"
        "def section(*a):\n    os.kill(os.getpid(), signal.SIGINT); return draw(*a)\n"
        "report.section = section; sys.exit(report.main(sys.argv[1:]))"
    )
    process = start(program, copy / "observation")
    _, said = process.communicate()
    assert process.returncode == 128 + signal.SIGINT
    assert said == "stopped; no page was written\n"
    assert not list((copy / "observation").glob("report*"))
