"""sgimd watch: a real TensorBoard shows what the files of a real run hold; bad requests are refused."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.parse
import urllib.request
import zipfile
from pathlib import Path

import numpy as np
import pytest
import tensorboard

from runs import ROOT
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.views.watch import boards_below, free_port, main

DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))
RUN = "sgim-d/seed-003"


@pytest.fixture(scope="module")
def runs(tmp_path_factory, go):
    out = tmp_path_factory.mktemp("runs")
    assert go(out, "--movements", 300, "--evaluate_at", "100,200", "--board", "true") == 0
    return out


def watching(runs, port):
    words = [sys.executable, "-m", "sgimd_torch", "watch", str(runs), "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.fixture(scope="module")
def server(runs):
    """The process, what it said first, and a function that asks it."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    port = free_port(7100 + 50 * worker)  # between asking and binding another worker could take the same
    with watching(runs, port) as process:
        timer = threading.Timer(120, process.kill)
        timer.start()
        try:
            said = "".join(process.stdout.readline() for _ in range(6))
            address = f"http://127.0.0.1:{port}"
            assert address in said, process.stderr.read()

            def ask(path, **query):
                with DIRECT.open(f"{address}/data/plugin/{path}?{urllib.parse.urlencode(query)}", timeout=30) as reply:
                    return json.load(reply)

            yield process, said, ask
        finally:
            process.terminate()  # a kill would leave TensorBoard behind
            process.wait()
            timer.cancel()


def test_beside_a_taken_port_it_names_its_own_and_terminating_it_ends_tensorboard_too(runs):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", free_port(8000)))
        taken.listen()
        asked = taken.getsockname()[1]
        with watching(runs, asked) as process:
            while not (address := re.search(r"http://127\.0\.0\.1:(\d+)", process.stdout.readline())):
                assert process.poll() is None
            process.terminate()
            _, errors = process.communicate(timeout=30)
        assert process.returncode == 143
        assert f"port {asked} is taken, {address[1]} is free" in errors
    with pytest.raises(OSError, match="refused"):
        DIRECT.open(address[0], timeout=5)


def curve(ask, tag):
    points = ask("scalars/scalars", run=RUN, tag=tag)
    return {int(step): value for _, step, value in points}


def test_the_server_has_every_evaluation_of_the_run(server, runs):
    _, _, ask = server
    evaluation = read_run(runs / RUN).evaluation
    for tag, column in {
        "error/mean": "mean_error_m",
        "error/median": "median_error_m",
        "error/p90": "p90_error_m",
        "error/noise_floor": "noise_floor_m",
    }.items():
        expected = dict(zip(evaluation["movements"].astype(int), evaluation[column], strict=True))
        assert curve(ask, tag) == pytest.approx(expected, rel=1e-6)


def test_the_server_has_the_regions_of_the_run(server, runs):
    _, _, ask = server
    regions = read_run(runs / RUN).regions
    for movements in (100, 200, 300):
        now = {name: column[regions["movements"] == movements] for name, column in regions.items()}
        assert curve(ask, "regions/count")[movements] == len(now["path"])
        for path in {name[:length] for name in now["path"] for length in (1, 2, 3)}:
            below = np.char.startswith(now["path"], path)
            competences, interests, goals = (now[name][below] for name in ("competence", "interest", "goals"))
            competence, interest = (np.nansum(values * goals) / goals.sum() for values in (competences, interests))
            assert curve(ask, f"competence/{path}")[movements] == pytest.approx(competence, rel=1e-5)
            assert curve(ask, f"interest/{path}")[movements] == pytest.approx(interest, rel=1e-5)


def test_the_server_has_what_the_log_says_about_regimes_and_demonstrations(server, runs):
    _, _, ask = server
    run = read_run(runs / RUN)
    shown = curve(ask, "teacher/demonstrations")
    assert shown == {step: (run.demonstration[:step] >= 0).sum() for step in range(50, 301, 50)}
    for origin in ("global", "local", "imitate"):
        shares = curve(ask, f"regime/{origin}")
        assert shares == pytest.approx({step: (run.origin[step - 50 : step] == origin).mean() for step in shares})
        assert max(shares) == 300


def test_the_server_explains_its_curves_and_shows_pictures_and_the_page_of_charts(server):
    _, _, ask = server
    tags = ask("scalars/tags")[RUN]
    assert all(tag["description"] for tag in tags.values())
    assert len(tags) < 70
    pictures = ask("images/tags")[RUN]
    assert pictures.keys() == {"competent/since", "map/competence", "map/interest", "map/landed", "map/error"}
    (page,) = [page for page in [ask("custom_scalars/layout")] if page]
    assert len(page["category"]) == 3


def test_the_first_address_is_the_page_to_begin_with_and_its_charts_show_every_value(server):
    _, said, _ = server
    first = re.search(r"http://\S+", said)[0]
    assert said.index("Begin here") < said.index(first)
    with DIRECT.open(first, timeout=30) as reply:
        page = reply.read().decode()
        assert reply.headers["Content-Type"].startswith("text/html")
    key, value = re.search(r'localStorage.setItem\("(.*?)", "(.*?)"\)', page).groups()
    assert value == "false"
    with zipfile.ZipFile(Path(tensorboard.__file__).with_name("webfiles.zip")) as assets:
        script = assets.read("index.js").decode()
    assert f'"{key}",{{defaultValue:!0,useLocalStorage:!0}}' in script  # what TensorBoard reads, and it is on by itself
    assert re.search(r"location.replace\(\"/#(.*?)\"\)", page)[1].startswith("custom_scalars&_smoothingWeight=0")


def test_ctrl_c_ends_it_without_a_traceback(server):
    process, said, _ = server
    assert "/begin" in said
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert "is taken" not in errors


def test_a_port_that_is_taken_is_passed_over():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert free_port(taken.getsockname()[1]) > taken.getsockname()[1]


@pytest.mark.parametrize(("options", "says"), [(["--port", "0"], "1 to 65535"), (["--prot", "1"], "--prot")])
def test_an_impossible_option_is_refused(runs, capsys, options, says):
    assert command(main, [str(runs), *options]) == 2
    assert says in capsys.readouterr().err


def test_runs_without_a_board_are_told_how_to_get_one(tmp_path, go, capsys):
    assert go(tmp_path) == 0
    assert command(main, [str(tmp_path)]) == 2
    assert "--board true" in capsys.readouterr().err
    assert command(main, [str(tmp_path / "nowhere")]) == 2
    assert "no directory" in capsys.readouterr().err


def test_boards_are_counted_by_run(runs):
    assert boards_below(runs) == boards_below(runs / RUN) == 1
