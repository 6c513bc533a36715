"""Reading runs: what was recorded as arrays, whether a run is finished, and what is no run."""

from dataclasses import replace

import numpy as np
import pytest

from runs import edit, write_about
from sgimd_torch.algorithms.paper import random_exploration
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.record import DERIVED, Record, RunError
from sgimd_torch.record.replay import save_life
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.read import config_of, find_runs, finished, movements_on_disk, read_run
from sgimd_torch.spaces import Demonstration

SHORT = "--algorithm random --environment planar-arm-7 --movements 8 --evaluate_at 5 --repeats 0 --seed 3"


@pytest.fixture
def run(tmp_path, go):
    """A short run of random movements."""
    assert go(tmp_path, *SHORT.split(), "--benchmark", "null") == 0
    return tmp_path / "random" / "seed-003"


def config_on(path):
    return parse([*SHORT.split(), "--out", str(path.parents[1])])[0]


def test_the_arrays_of_a_run_are_the_rows_of_its_record(reference, undisturbed):
    run = read_run(undisturbed)
    moved = [row for row in reference["events"] if row[1] == Kind.MOVED]
    found = np.hstack((run.contexts, run.thetas, run.goals, run.outcomes))
    np.testing.assert_array_equal(found, np.array([row[3:-6] for row in moved], dtype=np.float64))
    assert run.origin.tolist() == [row[2] for row in moved]
    assert run.index.tolist() == list(range(90))
    before = [reference["events"][k - 1] for k, row in enumerate(reference["events"]) if row[1] == Kind.MOVED]
    shown = [row[-6] if row[1] == Kind.SHOWN else -1 for row in before]
    assert run.demonstration.tolist() == shown
    assert run.benchmark.tolist() == [[0.0, 0.6], [0.3, 0.5], [-0.4, 0.4]]
    assert {name: len(column) for name, column in run.errors.items() if name != "context"} == dict.fromkeys(
        ("movements", "inverse", "goal", "error", "noise", "failed", "expected"), 3 * 3
    )
    assert run.robot == "FishingRod"
    assert run.spaces["outcomes"].low.tolist() == [-1, -1]


def test_a_column_of_an_evaluation_is_found_by_its_movements(run):
    found = read_run(run)
    assert found.at(5) == found.evaluation["mean_error"][0]
    assert found.at(8, "goals_met") == found.evaluation["goals_met"][1]
    assert np.isnan(found.at(6))
    assert found.errors["error"][found.errors["movements"] == 5][: len(found.benchmark)].mean() == found.at(5)


def test_whether_a_run_is_finished_is_counted_not_believed(run):
    config = config_on(run)
    assert read_run(run).summary["finished"] is True
    assert finished(config)
    assert finished(Config.from_settings({**config.settings, "board": True}))
    changes = {"movements": 9, "seed": 4, "evaluate_at": (6,), "floor_at": (), "repeats": 2}
    for name, value in changes.items():
        assert not finished(replace(config, **{name: value})), name
    assert not finished(replace(config, parts=dict(config.parts) | {"inverse": "nearest"}))
    assert movements_on_disk(run / "nowhere") == 0
    assert config_of(read_run(run)).settings == config.settings
    with Record(run / RUN_FILE, write=True) as record:
        record.replace_rows("evaluations", [row for row in record.rows("evaluations") if row[0] == 5])
        record.commit()
    assert read_run(run).summary["finished"] is False
    edit(run / RUN_FILE, "DELETE FROM events WHERE movement = 7")
    assert not finished(config)


def test_a_run_that_has_just_begun_is_read_as_empty(run):
    with Record(run / RUN_FILE, write=True) as record:
        for table in ("events", *DERIVED):
            record.replace_rows(table, ())
        record.commit()
    found = read_run(run)
    assert found.thetas.shape == (0, 7)
    assert found.evaluation["mean_error"].shape == (0,)
    assert found.regions is found.requests is found.predictions is None
    assert found.summary["finished"] is False
    assert movements_on_disk(run) == 0


def test_what_is_no_run_is_refused(tmp_path, run):
    (tmp_path / "old").mkdir()
    save_life(random_exploration(PlanarArm(7), 0), tmp_path / "old" / RUN_FILE)
    (tmp_path / "csv").mkdir()
    for path, message in (
        (tmp_path, "holds no run;"),
        (tmp_path / "nowhere", "holds no run;"),
        (tmp_path / "csv", "holds no run;"),
        (tmp_path / "old", r"is a life that save_life wrote"),
    ):
        with pytest.raises(RunError, match=message):
            read_run(path)
        assert movements_on_disk(path) == 0
    with pytest.raises(RunError, match="holds no runs"):
        find_runs(tmp_path / "csv")
    with pytest.raises(RunError, match="does not exist"):
        find_runs(tmp_path / "nowhere")
    write_about(run, settings={**read_run(run).config, "algorithm": "gone"})
    with pytest.raises(RunError, match="do not describe a run of this version"):
        config_of(read_run(run))


def test_runs_are_found_by_name_and_seed(tmp_path):
    for name, seed in (("b", 10), ("b", 2), ("a", 0)):
        (tmp_path / name / f"seed-{seed:03d}").mkdir(parents=True)
        (tmp_path / name / f"seed-{seed:03d}" / RUN_FILE).touch()
    found = find_runs(tmp_path)
    assert list(found) == ["a", "b"]
    assert [path.name for path in found["b"]] == ["seed-002", "seed-010"]
    assert find_runs(tmp_path / "b") == {"b": found["b"]}
    assert find_runs(found["b"][1]) == {"b": [found["b"][1]]}


@pytest.mark.parametrize(
    "reference",
    [
        "sgimd_torch.inverses.gaussian_process:optimize._trustregion.scipy.signal._signaltools.timeit.timeit",
        "sgimd_torch.files:os.getcwd",
        "sgimd_torch.__main__:main",
        "sgimd_torch.tasks.robots:PlanarArm.__init__",
    ],
)
def test_a_record_executes_no_code_without_trust_though_its_reference_is_in_this_library(run, reference):
    found = read_run(run)
    for name in ("environment", "algorithm"):
        with pytest.raises(RunError, match="names code outside this library"):
            config_of(replace(found, config={**found.config, name: reference}))


def test_a_reference_of_the_catalogue_needs_no_trust(run):
    found = read_run(run)
    reference = "sgimd_torch.tasks.robots:planar_arm_7"
    assert config_of(replace(found, config={**found.config, "environment": reference}))["environment"] == reference


def test_a_request_has_the_demonstration_that_follows_it_and_no_later_one(run):
    first, second = (Demonstration(np.zeros(0), np.arange(2.0), np.full((2, 7), k), np.full(2, k)) for k in (0.1, 0.2))
    wanted = Event(Kind.ASKED, np.zeros(0), goal=np.full(2, 0.5), who="left", strategy="imitate left", reply="shown")
    moved = Event(Kind.MOVED, np.zeros(0), np.full(7, 0.5), None, np.zeros(2), "imitate")
    with Record(run / RUN_FILE, write=True) as record:
        for event in (
            *(wanted, Event(Kind.SHOWN, lesson=first, who="left"), moved),
            *(Event(Kind.SHOWN, lesson=second), moved),  # somebody else, without a request
            *(wanted._replace(reply="nothing"), Event(Kind.SHOWN, lesson=second), moved),
            *(wanted._replace(who="right"), Event(Kind.SHOWN, lesson=second, who="right"), moved),
        ):
            record.add(event)
        record.commit()
    found = read_run(run)
    assert found.requests["teacher"].tolist() == ["left", "left", "right"]
    assert found.requests["shown"].tolist() == [0, -1, 1]
    assert found.requests["index"].tolist() == [8, 10, 11]
    assert found.demonstration[8:].tolist() == [0, 1, 1, 1]
