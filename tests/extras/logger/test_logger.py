"""Loggers of Lightning: what they get is what the board shows, also after a resume."""

import csv
import importlib.util
from pathlib import Path

import pytest

from boards import curves_of
from sgimd_torch.board.listener import hparams_of
from sgimd_torch.extras.logger.hook import Logging
from sgimd_torch.options.config import Config
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command

pytest.importorskip("lightning")
BOARD = ["--board", "true"]
WORDS = ["--algorithm=sagg-riac", "--environment=planar-arm-7", "--repeats=0", "--evaluate-at=50", "--out=runs", *BOARD]
DIRECTORY = Path("runs/sagg-riac/seed-000")


def without_commas(curves):
    return {tag.replace(",", ""): curve for tag, curve in curves.items()}


def test_a_csv_file_has_the_curves_of_the_board_a_row_for_each_step_from_the_first_also_after_a_resume(own):
    for version, movements in enumerate((60, 120)):
        resume = ["--resume"] if version else []
        assert command(main, [*WORDS, "--movements", str(movements), "--logger", "csv", *resume]) == 0
        with (DIRECTORY / f"csv/version_{version}/metrics.csv").open() as file:
            rows = [*csv.DictReader(file)]
        steps = [int(row.pop("step")) for row in rows]
        assert steps == sorted(set(steps))
        found = {tag: {s: float(row[tag]) for s, row in zip(steps, rows, strict=True) if row[tag]} for tag in rows[0]}
        wanted = without_commas(curves_of(DIRECTORY))
        assert found.keys() == wanted.keys()
        assert all(found[tag] == pytest.approx(wanted[tag], rel=1e-6) for tag in wanted)


def test_mlflow_gets_the_same_in_a_folder_of_all_runs(own, monkeypatch):
    """Without MLflow, a stand-in for its logger, which refuses what MLflow refuses."""
    from lightning.pytorch import loggers

    got = {}

    class StandIn:
        def __init__(self, experiment, run_name, uri):
            got.update(at=(experiment, run_name, uri), curves={})

        def log_hyperparams(self, values):
            got["hparams"] = values

        def log_metrics(self, values, step):
            for tag, value in values.items():
                assert not {*tag} & {*",()$\\"}
                got["curves"].setdefault(tag, {})[step] = value

        def save(self):
            pass

        def finalize(self, status):
            got["status"] = status

    monkeypatch.setattr(loggers, "MLFlowLogger", StandIn)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    assert command(main, [*WORDS, "--movements", "60", "--logger", "mlflow"]) == 0
    assert got["at"] == ("sgimd_torch", "sagg-riac seed 0", f"file:{Path('runs/mlruns').resolve()}")
    assert got["hparams"] == hparams_of(Config(algorithm="sagg-riac", parts={"environment": "planar-arm-7"}))
    wanted = without_commas(curves_of(DIRECTORY))
    assert got["curves"].keys() == wanted.keys()
    assert all(got["curves"][tag] == pytest.approx(wanted[tag], rel=1e-6) for tag in wanted)
    assert got["status"] == "success"


def test_wrong_requests_are_refused_before_a_run_begins(own, capsys, monkeypatch):
    with pytest.raises(ValueError, match="csv"):
        Logging(logger="cvs")
    assert command(main, [*(word for word in WORDS if word not in BOARD), "--logger", "csv"]) == 2
    assert "needs --board true" in capsys.readouterr().err
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "lightning" else name)
    assert command(main, [*WORDS, "--logger", "csv"]) == 2
    assert "needs lightning, which is not installed" in capsys.readouterr().err
    assert not Path("runs").exists()
