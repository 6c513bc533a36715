"""The swimmer of gymnasium as a task: it keeps every promise, and its demonstrations can be translated."""

import numpy as np
import pytest

from sgimd_torch.demonstrations.fit import misfit_of
from sgimd_torch.extras.check.promises import check_environment
from sgimd_torch.extras.gymnasium.from_gymnasium import measured_noise
from sgimd_torch.spaces import stream
from sgimd_torch.tasks import benchmark_of
from sgimd_torch.tasks.taught import demonstrations_of
from swimmer import Swimmer, swimmer

NO_CONTEXT = np.zeros(0)


def test_a_wave_along_its_body_moves_the_swimmer_and_the_opposite_one_moves_it_back():
    still = Swimmer(start=0.0)
    ahead, back = (still.execute(NO_CONTEXT, [1, 0, 0.5, 1, lag, 0.5, 0.25], stream(0, "any")) for lag in (0.25, 0.75))
    assert np.linalg.norm(ahead) > 0.5
    assert np.linalg.norm(back) > 0.5
    assert ahead @ back < 0
    assert np.linalg.norm(still.execute(NO_CONTEXT, [0, 0, 0.5, 0, 0, 0.5, 0.5], stream(0, "any"))) < 1e-9


def test_the_swimmer_is_a_task_that_keeps_every_promise_with_goals_and_demonstrations():
    task = swimmer()
    check_environment(task.environment)
    assert measured_noise(task.environment, stream(1001, "noise")) == pytest.approx(
        task.environment.outcome_noise, rel=0.25
    )
    benchmark, _, _ = benchmark_of(task, None)
    assert len(benchmark.goals) > 100
    demonstrations, _, _ = demonstrations_of(task, None)
    assert len(demonstrations) == 100
    translated = [task.environment.correspondence(each.times, each.trajectory) for each in demonstrations]
    misfits = [misfit_of(task.environment, *each) for each in zip(translated, demonstrations, strict=True)]
    assert np.median(misfits) == pytest.approx(0.0347, abs=5e-5)  # the hand shook
    still = Swimmer(start=0.0)
    for each in demonstrations[:3]:
        np.testing.assert_allclose(still.replay(each.times, each.trajectory), each.outcome, atol=1e-9)
        theta = still.correspondence(each.times, each.trajectory)
        landed = still.execute(NO_CONTEXT, theta, stream(0, "any"))
        assert np.linalg.norm(landed - each.outcome) < 0.3
    with pytest.raises(ValueError, match=r"a movement lasts 5.96 s at most, the recording 6 s"):
        still.replay(0.04 * np.arange(151), np.zeros((151, 2)))
