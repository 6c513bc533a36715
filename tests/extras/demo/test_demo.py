"""The demo: three runs of a few movements on a benchmark of a few goals, its figure and its table."""

import shlex
from pathlib import Path

import numpy as np

from runs import content_of, start
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.extras.demo.command import configs_of, main
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run

LEARNERS = ("random", "sgim-d", "practice-taught")
DEMO = "import sys; from sgimd_torch.__main__ import main; sys.argv.insert(1, 'demo'); sys.exit(main())"


def test_the_demo_ends_with_all_runs_a_figure_and_a_table_and_a_second_start_uses_them(tmp_path, capsys):
    out, benchmark = tmp_path / "out", tmp_path / "small.npz"
    save_benchmark(benchmark, Benchmark("FishingRod", np.array([[0.0, 0.5], [0.4, 0.3], [-0.5, 0.2]]), 0.1))
    options = [*f"--movements 40 --benchmark {benchmark} --evaluate_at 30 --out {out}".split()]
    process = start(DEMO, *options)
    printed, said = process.communicate()
    assert process.returncode == 0, said
    runs = {algorithm: read_run(out / algorithm / "seed-000") for algorithm in LEARNERS}
    assert [len(run.index) for run in runs.values()] == [40, 40, 40]
    figure = (out / "demo.png").read_bytes()
    assert figure.startswith(b"\x89PNG\r\n\x1a\n")
    assert str(out / "demo.png") in printed
    assert "SGIM-D chooses goals" in said  # what it is doing
    lines = {line.split()[0]: line.split() for line in printed.splitlines() if line}
    assert all(lines[name][3] == f"{run.at(40):.3f}" for name, run in runs.items())
    commands = printed.partition("Next, try\n")[2].splitlines()
    assert len(commands) == 2
    for line in commands:
        program, name, *words = shlex.split(line, comments=True)
        assert (program, name in WORDS["command"]) == ("sgimd", True)
        assert any(Path(word).exists() for word in words)

    content = [content_of(run.path) for run in runs.values()]
    (out / "demo.png").unlink()
    assert command(main, options) == 0
    assert [content_of(run.path) for run in runs.values()] == content
    assert (out / "demo.png").read_bytes() == figure
    capsys.readouterr()
    assert command(main, [*options, "--movements", "30"]) == 1
    said = capsys.readouterr().err
    assert "40 movements already" in said
    assert "Traceback" not in said


def test_options_of_a_run_are_those_of_all_three():
    configs = configs_of(["--seed", "4", "--movements=70", "--environment.noise", "0"])
    assert [*configs] == [*LEARNERS]
    runs = configs.values()
    given = {(config.seed, config["environment.noise"], config.movements, config.floor_at) for config in runs}
    assert given == {(4, 0.0, 70, ())}  # the noise floor would take a tenth of the time
    assert {config.out for config in configs_of([]).values()} == {Path("runs/demo")}
