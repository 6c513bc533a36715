"""Runs where there are contexts: their evaluations draw them, and say the error by context."""

import numpy as np

from sgimd_torch.evaluation import contexts_of_goals
from sgimd_torch.options.build import task_of
from sgimd_torch.options.command_line import main
from sgimd_torch.options.config import Config
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.signals import command
from sgimd_torch.runs.tasks.taught import demonstrations_of


def test_the_rod_in_the_wind_is_a_task():
    config = Config("sgim-d", parts={"environment.max_wind": 0.05, "environment.noise": 0.01})
    robot = task_of(config).environment
    assert (robot.contexts.low.tolist(), robot.contexts.high.tolist()) == ([-0.05], [0.05])
    assert robot.noise == 0.01
    demonstrations, *_ = demonstrations_of(task_of(config), None)
    assert [shown.context.tolist() for shown in demonstrations] == [[0.0]] * 127
    contexts = contexts_of_goals(robot, 200)
    assert np.ptp(contexts) > 0.09


def test_the_rod_in_the_wind_is_run_and_taught(tmp_path, benchmark):
    words = "--algorithm sgim-d --environment.max_wind 0.05 --movements 45 --evaluate-at 35 --repeats 2"
    assert command(main, [*words.split(), "--benchmark", str(benchmark), "--out", str(tmp_path)]) == 0
    run = read_run(tmp_path / "sgim-d/seed-000")
    assert run.contexts.shape == (45, 1)
    assert np.abs(run.contexts).max() <= 0.05
    assert (run.demonstration >= 0).any()
    assert len(run.errors["context_0"]) == 2 * 3  # evaluations, goals
