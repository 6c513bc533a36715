"""The paper's figures from tiny runs: which runs are made, every figure and table of the page, and the statistics."""

import base64
import io
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pages import Page, alts, drawn, rows_of
from runs import write_about
from sgimd_torch.extras.paper import command as paper
from sgimd_torch.extras.paper import figures as paper_figures
from sgimd_torch.extras.paper.replication import Replication
from sgimd_torch.extras.table.names import COLOURS
from sgimd_torch.extras.table.variants import Variant
from sgimd_torch.options.config import words
from sgimd_torch.runs.command import main as live
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Box

FIGURES = [
    *("Error curves of the five learners", "Error curves by demonstrator"),
    "Histograms of outcomes of Random, SAGG-RIAC and SGIM-D",
    *("Trajectories of joint 1 by demonstrator", "Means of the parameters of theta by demonstrator"),
    *("Error curves in both task spaces", "Goals of SAGG-RIAC and SGIM-D in the larger task space"),
    *("Two joints of a recording, as recorded and as repeated", "Benchmark goals, and outcomes of the demonstrators"),
    "Outcomes of three policies, each repeated",
]


@pytest.fixture(scope="module")
def tiny(tmp_path_factory, benchmark):
    """Folder of the runs and of the page, options, and the plan; the runs are made in this process."""
    out = tmp_path_factory.mktemp("paper")
    given = f"--movements 40 --evaluate-at 20 --repeats 0 --benchmark {benchmark}".split()
    plan = paper.plan_of(out, given, ours=False)
    for config in plan.values():
        assert command(live, words(config)) == 0
    return out, [str(out), "--seeds", "0", *given], plan


@pytest.fixture(scope="module")
def study(tiny):
    plan = tiny[2]
    runs = {name: Variant(name, [read_run(config.directory)]) for name, config in plan.items()}
    return Replication(plan["sgim-d"], runs)


@pytest.fixture(scope="module")
def page(tiny):
    assert command(paper.main, tiny[1]) == 0
    return (tiny[0] / "paper.html").read_text(encoding="utf-8")


def test_the_learners_are_those_of_the_paper_unless_ours_are_wanted(tiny):
    plan, ours = tiny[2], paper.plan_of(tiny[0], [], ours=True)
    assert {name: config["inverse"] for name, config in plan.items()} == dict.fromkeys(plan, "paper")
    assert {name: config["inverse"] for name, config in ours.items()} == dict.fromkeys(plan, "process")
    assert [plan[name].algorithm for name in ("sagg-riac", "sgim-d-large")] == ["sagg-riac-letter", "sgim-d-letter"]
    varied = {name: config["exact_first"] for name, config in plan.items() if name.startswith("imitation")}
    varied |= {name: config["social.exact_first"] for name, config in plan.items() if name.startswith("sgim-d")}
    assert not any(varied.values())
    assert "changes" not in {config.settings.get("watch") for config in plan.values()}
    assert [config.demonstrations.stem[-1] for config in plan.values() if config.demonstrations] == [*"111222"]
    assert [name for name, config in plan.items() if config["environment.task_space"] == 100] == [
        *("sagg-riac-large", "sgim-d-large")
    ]


def test_the_page_waits_for_the_last_run(tiny, capsys):
    _, options, _ = tiny
    assert command(paper.main, [*options, "--seeds", "0-1", "--dry-run"]) == 0
    said = capsys.readouterr()
    assert len(said.out.splitlines()) == 13
    assert "13 of 26 are left" in said.err


def test_every_figure_is_on_the_page_beside_its_statement_and_nothing_is_fetched(page):
    assert alts(page) == FIGURES
    for content in re.findall(r"base64,([A-Za-z0-9+/=]*)", page):
        with Image.open(io.BytesIO(base64.b64decode(content))) as picture:
            assert min(picture.size) >= 400
    assert not re.search(r"https?:|file:|<script", re.sub(r"base64,[A-Za-z0-9+/=]*", "", page))
    assert re.findall(r"<strong>The paper \(sections? [456]\.|<img ", page)[1::2] == ["<img "] * len(FIGURES)
    assert [text for text in Page(page).all("strong") if text.startswith("The paper")] == [
        f"The paper ({place})."
        for place in (
            *("section 6.1, fig. 8a", "section 6.3, fig. 8b", "section 6.2, fig. 8c", "section 6.3, fig. 8d"),
            *("section 6.3", "section 6.4, fig. 8e", "section 6.5, fig. 8f", "section 4.1, fig. 5"),
            *("sections 5.2 and 5.3, fig. 7b, c", "section 4.5, fig. 6"),
        )
    ]


def test_numbers_are_those_of_the_runs(page, study):
    errors = {name: variant.runs[0].at(40) for name, variant in study.variants.items()}
    rows = {row[0]: row[1:] for row in rows_of(page, "Errors after the last movement, divided by each other")}
    assert rows["SGIM-D / Random"] == ["½", f"{errors['sgim-d'] / errors['random']:.2f}"]
    rows = {row[0]: row[1:] for row in rows_of(page, "Errors after the last movement (m)")}
    names = ("imitation-demonstrator-1", "imitation-demonstrator-2", "imitation")
    assert rows["Imitation"] == [f"{errors[name]:.3f}" for name in names]
    ratio = errors["sgim-d-large"] / errors["sgim-d"]
    assert study.large().rows[2][1:] == (f"{errors['sgim-d']:.3f}", f"{errors['sgim-d-large']:.3f}", f"{ratio:.2f}")


def test_a_large_t_of_the_page_is_no_warning_and_other_remarks_are(tiny, tmp_path):
    out = shutil.copytree(tiny[0], tmp_path / "paper")
    plan = {name: replace(config, out=out) for name, config in tiny[2].items()}
    for name in ("random", "sgim-d-large"):
        write_about(plan[name].directory, remarks={"outcomes": {"narrow": f"{name} is told"}})
    told = Page(paper.page(plan, [0])).all("li")
    assert [text.rpartition(": ")[2] for text in told if text.endswith("told.")] == ["random is told."]


def test_only_demonstrator_3_moves_each_joint_in_one_direction(study):
    assert [row[3] == "100%" for row in study.monotonic().rows] == [False, False, True]


def test_repeated_policies_scatter_only_by_the_noise_of_the_rod(study):
    assert study.repeated.shape == (20, 20, 2)
    assert (study.repeated.std(axis=1) > 0).all()
    without = paper.plan_of(Path(), ["--environment.noise", "0"], ours=False)["sgim-d"]
    assert (np.ptp(Replication(without, {}).repeated, axis=1) == 0).all()


def test_two_joints_of_a_recording_and_the_points_of_all_sets_are_drawn(study):
    worst, best = study.mapped()
    assert 0.01 < worst.misfit > 2 * best.misfit
    for joint, ax in zip((worst, best), drawn(paper_figures.mapping, study).axes, strict=True):
        recorded, repeated, knots = (line.get_ydata() for line in ax.lines)
        assert np.sqrt(np.mean((repeated - recorded) ** 2)) == pytest.approx(joint.misfit)
        assert knots.min() <= repeated.min() <= repeated.max() <= knots.max()  # means of the knots, eq. (5)
    points = [len(ax.lines[0].get_xdata()) for ax in drawn(paper_figures.maps, study).axes]
    assert points == [len(study.variants["sgim-d"].runs[0].benchmark), 127, 127, 127]


def test_parameters_with_other_means_or_spreads_are_counted(tiny):
    rng = np.random.default_rng(0)
    one, two, three = rng.uniform(size=(3, 300, 25))
    two[:, 0] += 0.3
    three[:, 1:3] = 0.5 + 0.1 * (three[:, 1:3] - 0.5)
    other = Replication(tiny[2]["sgim-d"], {})
    other.taught, other.demonstrated = {1: one, 2: two, 3: three}, {1: one}
    of_random, of_taught = other.anova().rows
    assert (of_random[1], of_random[4]) == ("0 of 25", "0 of 25")
    assert (of_taught[1], of_taught[4]) == ("1 of 25", "2 of 25")


def test_curves_have_the_colours_of_their_learners_and_histograms_one_scale(study):
    panels = {"low": {"sgim-d": "sgim-d-large", "random": "random"}, "high": {"observation": "observation"}}
    ax, other = drawn(paper_figures._panels, study, panels).axes
    assert ax.get_ylim()[1] == other.get_ylim()[1] > max(line.get_ydata().max() for line in (*ax.lines, *other.lines))
    assert [line.get_color() for line in ax.lines] == [COLOURS["sgim-d"], COLOURS["random"]]
    figure = drawn(paper_figures.outcomes, study)
    *maps, _ = figure.axes
    assert len({mesh.get_clim() for ax in maps for mesh in ax.collections}) == 1
    counted = sum(mesh.get_array().sum() for ax in maps for mesh in ax.collections)
    assert 0.97 * 3 * 40 <= counted < 3 * 40  # without the farthest
    whole, near = drawn(paper_figures.goals, study).axes[:2]
    assert len(whole.lines[0].get_xdata()) == len(study.chosen("sagg-riac"))
    assert near.get_xlim() == (-100, 100)


@pytest.mark.parametrize(("most", "n_axes"), [(1e-9, 2), (100, 4)])
def test_goals_in_the_papers_t_are_drawn_if_there_are_any(study, monkeypatch, most, n_axes):
    monkeypatch.setattr(paper_figures, "SMALL", Box.cube(-most, most, 2))
    assert len(drawn(paper_figures.goals, study).axes) == n_axes
