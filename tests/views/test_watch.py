"""sgimd watch: a real TensorBoard on the boards of runs; bad requests are refused."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest

from runs import ROOT
from sgimd_torch.__main__ import _call
from sgimd_torch.runs.process import command
from sgimd_torch.views.watch import main

DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    out = tmp_path_factory.mktemp("runs")
    assert go(out, "--board", "true") == 0
    return out


def watching(runs, port):
    words = [sys.executable, "-m", "sgimd_torch", "watch", str(runs), "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ask(url, path):
    with DIRECT.open(f"{url}data/{path}") as reply:
        return json.load(reply)


def test_it_prints_its_address_and_ctrl_c_ends_it_and_tensorboard_without_a_traceback(runs):
    with watching(runs, 0) as process:
        begin = next(line for line in process.stdout if "Begin here" in line)
        url = re.search(r"(http://127\.0\.0\.1:\d+/)#custom_scalars", begin)[1]
        assert ask(url, "environment")["data_location"] == str(runs)  # runs that are added appear
        assert {"scalars", "images", "text", "custom_scalars", "hparams"} <= ask(url, "plugins_listing").keys()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in errors
    with pytest.raises(OSError, match="refused"):
        ask(url, "environment")


def test_a_port_that_is_taken_is_refused(runs):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with watching(runs, taken.getsockname()[1]) as process:
            _, errors = process.communicate()
    assert process.returncode == 1
    assert "give another --port" in errors


def test_runs_without_a_board_are_told_how_to_get_one(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command(main, ["."]) == 2
    assert "--board true" in capsys.readouterr().err


def test_a_missing_package_is_named_with_its_extra(runs, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    assert command(_call, ["watch", str(runs)]) == 2
    assert "pip install 'sgimd-torch[board]'" in capsys.readouterr().err
