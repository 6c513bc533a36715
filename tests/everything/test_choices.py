"""Every word that core and rooms bring: each choice of a part runs and differs; every command ends at Ctrl-C."""

import os
import signal
import subprocess
import sys

import pytest

from runs import ROOT, content_of
from sgimd_torch.options.catalogue import WORDS

SCRIPTS = {**os.environ, "PYTHONPATH": str(ROOT)}


@pytest.mark.parametrize(
    ("kind", "table"),
    [
        item
        for item in WORDS.items()
        if item[0] not in ("algorithm", "environment", "command", "network", "watch", "memory", "hook")
    ],
)
def test_every_choice_runs_and_differs_from_the_others(tmp_path, go, kind, table):
    logs = set()
    option = {"progress": "goals.progress", "choose": "teacher.choose"}.get(kind, kind)
    # Short attempts and a short window, so that the map is split, and has its say, before the run is over.
    common = ["--evaluate_at", "[]", "--environment", "planar-arm-7", "--benchmark", "null"]
    common += ["--movements", 240 if kind in ("goals", "progress", "judge") else 120]
    common += ["--algorithm", "sgim-im"] if kind == "teachers" else ["--budget", 3]
    common += ["--algorithm", "sagg-riac"] if kind == "judge" else []
    common += ["--teacher.every", 20] if kind == "choose" else []
    common += ["--goals.window", 4] if kind == "progress" else []
    common += ["--environment", "fishing-rod"] if kind in ("teachers", "judge") else []
    # Models have test_run_model.py; a person who is not there is like no teacher, and demonstrator 3 is all there are.
    left_out = "gradient", "model", "model-alone", "by-hand", "demonstrator-3"
    choices = [choice for choice in table if choice not in left_out]
    for choice in choices:
        assert go(tmp_path, "--name", choice, f"--{option}", choice, *common) == 0
        logs.add(tuple(content_of(tmp_path / choice / "seed-003")["events"]))
    # On an arm, where every movement has an effect, this is `process`.
    assert len(logs) == len(choices) - ("among-effects" in choices)


@pytest.mark.parametrize(
    "script",
    [
        *(f"-m sgimd_torch {words}" for words in ("run --out", "demo --out", "table", "report")),
        *(f"experiments/{name}.py" for name in ("compare", "claims", "figures")),
    ],
)
def test_ctrl_c_while_python_imports_shows_no_traceback(script, tmp_path):
    command = [sys.executable, "-X", "importtime", *script.split(), str(tmp_path)]
    said = ""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=SCRIPTS, cwd=ROOT) as process:
        for line in process.stderr:  # importtime tells what is loaded, as it goes
            said += line
            if " numpy." in line:
                process.send_signal(signal.SIGINT)
                break
        said += process.stderr.read()
    assert process.returncode == 130
    assert "Traceback" not in said
