"""What travels between a run on a node and its directory at home: nothing is lost, nothing is sent twice."""

import json
import os

import pytest

from runs import csv_of, sweep_here
from sgimd_torch.files import lock, locked
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.engines import local
from sgimd_torch.runs.engines.parcels import Keeper, Parcel, carry_out, contents
from sgimd_torch.runs.read import finished, movements_on_disk

SGIMD = ("-m", "sgimd_torch")
FRESH = "holds no run yet"  # what a run says that does not go on from somewhere


def arm(out, **changes):
    settings = {"movements": 300, "evaluate_at": (50, 150), "repeats": 0, **changes}
    return Config.from_settings({"algorithm": "sgim-d", **settings, "out": out, "environment": "planar-arm-7"})


def task(keeper, config, every=0.0):
    return carry_out(keeper, config, (), SGIMD, every)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What a run of this machine writes."""
    config = arm(tmp_path_factory.mktemp("alone"))
    assert sweep_here([config]) == []
    return config


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(local, "LOOK_EVERY", 0.02)  # so that there is something to stop
    return tmp_path


class Watched(Keeper):
    """Stops after so many sendings, and looks at what is at home after each."""

    def __init__(self, home, config, sendings=10**9):
        super().__init__(str(home))
        self.config, self.sendings, self.bytes = config, sendings, 0

    def keep(self, config, turn, parts):
        wanted = super().keep(config, turn, parts)
        self.bytes += sum(len(part[1]) for name, part in parts.items() if name.endswith("episodes.csv"))
        summary = config.directory / "summary.json"
        counted = json.loads(summary.read_text())["movements"] if summary.exists() else 0
        assert counted <= movements_on_disk(config.directory)
        self.sendings -= movements_on_disk(config.directory) > 0
        if self.sendings == 0:
            self.stop()
        return wanted


def test_a_distant_run_is_what_it_would_be_here(home, alone):
    config = arm(home / "study")
    assert task(Keeper(str(home)), config) is None
    assert finished(config)
    assert csv_of(config.directory) == csv_of(alone.directory)
    names = [{path.name for path in each.directory.iterdir()} for each in (config, alone)]
    assert names[0] == names[1]
    settings = [json.loads((each.directory / "config.json").read_text()) for each in (config, alone)]
    assert settings == [{**settings[1], "out": str(each.out)} for each in (config, alone)]
    assert config.directory.with_suffix(".log").read_text() == alone.directory.with_suffix(".log").read_text().replace(
        str(alone.out), str(config.out)
    )


def test_a_run_that_is_stopped_goes_on_from_what_was_sent_and_each_byte_is_sent_once(home, alone):
    config = arm(home)
    first = Watched(home, config, sendings=1)
    assert task(first, config) is None
    sent = (config.directory / "episodes.csv").read_bytes()
    assert 1 < sent.count(b"\n") < 301
    assert first.bytes == len(sent)
    assert not locked(config.directory / "lock")
    second = Watched(home, config)
    assert task(second, config) is None
    assert FRESH not in config.directory.with_suffix(".log").read_text()
    assert csv_of(config.directory) == csv_of(alone.directory)
    assert second.bytes == (config.directory / "episodes.csv").stat().st_size - len(sent)


def test_what_a_task_sends_after_another_has_taken_its_place_is_not_kept(home, tmp_path):
    config, keeper = arm(home / "study"), Keeper(str(home))
    (early, late) = (Parcel(keeper, config, tmp_path / name, 0.0) for name in ("early", "late"))
    for parcel, text in ((early, "early"), (late, "late"), (early, "early again")):
        parcel.config.directory.mkdir(parents=True, exist_ok=True)
        (parcel.config.directory / "regions.csv").write_text(text)
        parcel.send()
    assert contents(config) == {"sgim-d/seed-000/regions.csv": b"late"}
    assert [early.stopped(), late.stopped()] == [True, False]
    early.end()
    assert locked(config.directory / "lock")
    late.end()
    assert not locked(config.directory / "lock")


def test_files_that_grow_are_replaced_or_go_are_the_same_at_home(home, tmp_path):
    config = arm(home / "study")
    parcel = Parcel(Keeper(str(home)), config, tmp_path / "there", 0.0)
    here, there = config.directory, parcel.config.directory
    (there / "board").mkdir(parents=True)
    for content in ("", "one\n", "one\ntwo\n", "another one\n", "an", None):
        path = there / "board" / "events"
        path.unlink() if content is None else path.write_text(content)
        parcel.send()
        assert contents(config) == ({} if content is None else {"sgim-d/seed-000/board/events": content.encode()})
    assert [path.name for path in here.iterdir() if path.is_file()] == ["lock"]


def test_a_run_of_another_process_is_waited_for(home):
    config, keeper = arm(home), Keeper(str(home))
    config.directory.mkdir(parents=True)
    held = lock(config.directory / "lock")
    assert keeper.begin(config) is None
    assert keeper.states() == {config.directory: "held"}
    os.close(held)
    assert keeper.begin(config) is not None
    assert keeper.states() == {config.directory: "running"}


def test_files_that_options_name_go_along(home, benchmark):
    (home / "goals.npz").write_bytes(benchmark.read_bytes())
    config = Config("random", movements=5, repeats=0, benchmark=home / "goals.npz", out=home / "study")
    assert task(Keeper(str(home)), config) is None
    assert finished(config)
    assert json.loads((config.directory / "config.json").read_text())["benchmark"] == str(home / "goals.npz")


def test_a_run_that_is_refused_names_the_place_at_home(home):
    config = arm(home)
    config.directory.mkdir(parents=True)
    (config.directory / "thesis.txt").write_text("not a run")
    error = task(Keeper(str(home)), config)
    assert isinstance(error, ValueError)
    assert f"{config.directory} holds thesis.txt" in str(error)
    assert f"Its whole log: {config.directory.with_suffix('.log')}" in str(error)
    assert not locked(config.directory / "lock")


def test_a_directory_that_cannot_be_made_is_an_error_of_its_run(home):
    (home / "sgim-d").write_text("a file")
    error = task(Keeper(str(home)), arm(home))
    assert isinstance(error, OSError)
    assert "sgim-d is no folder" in str(error)


def test_a_process_that_dies_is_a_failure_and_not_started_again(home):
    error = carry_out(Keeper(str(home)), arm(home), (), ("-c", "import os; os.kill(os.getpid(), 9)"), 0.0)
    assert "stopped by SIGKILL" in str(error)
