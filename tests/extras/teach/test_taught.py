"""A taught run without a page: lessons enter the run, which goes on, also without anybody."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.teach.by_hand import BY_HAND, ByHand
from sgimd_torch.extras.teach.command import options_of
from sgimd_torch.extras.teach.taught import TaughtRun
from sgimd_torch.options.config import Config, words
from sgimd_torch.runs.command import main as sgimd_run
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.tasks.robots import arm_demonstrations

SHOWN = arm_demonstrations(PlanarArm())


@pytest.fixture
def taught(tmp_path):
    """Opens a run on the small arm, which the test closes; it has made some movements."""

    def open_run(movements_made=30, **options):
        settings = {"algorithm": "sgim-d", "teacher": "by-hand", "movements": 300, "evaluate_at": (20,), **options}
        fixed = {"name": "taught", "out": tmp_path, "repeats": 0, "environment": "planar-arm-7"}
        run = TaughtRun(Config.from_settings({**settings, **fixed}))
        run.go_on(movements_made)
        return run

    return open_run


def recorded(run):
    """The first 40 rows of each column of the record."""
    read = read_run(run.config.directory)
    columns = read.contexts, read.thetas, read.goals, read.outcomes, read.origin, read.demonstration
    return [column[:40].tolist() for column in columns]


def test_a_lesson_is_answered_at_once_and_the_map_is_better_where_it_landed(taught):
    run = taught()
    before = run.status()
    assert (before.movements, before.lessons) == (30, 0)
    after = run.show(SHOWN[120])
    assert (after.movements, after.lessons) == (30 + run.config["social.repeats"], 1)
    box = run.parts.environment.outcomes
    column, row = ((SHOWN[120].outcome - box.low) / box.sides * after.chart.distances.shape[0]).astype(int)
    assert after.chart.distances[row, column] < 0.05 < before.chart.distances[row, column]
    run.close()
    read = read_run(run.config.directory)
    assert set(read.origin[30:]) == {"imitate"}
    np.testing.assert_array_equal(read.demonstrations[read.demonstration[30]].trajectory, SHOWN[120].trajectory)


def test_a_teacher_of_the_run_shows_the_same_whether_or_not_a_person_does():
    class Counting:
        def offer(self, index, memory):
            return SHOWN[index]

    hand, offered = ByHand(teacher=Counting()), []
    for index in range(4):
        if index == 2:
            hand.give(SHOWN[50])
        offered.append((hand.offer(index, None), hand.who))
    assert [demonstration for demonstration, _ in offered] == [SHOWN[0], SHOWN[1], SHOWN[50], SHOWN[3]]
    assert [who for _, who in offered] == ["teacher", "teacher", BY_HAND, "teacher"]


@pytest.mark.parametrize("teacher", ["by-hand", "periodic"])
def test_it_goes_on_where_it_was_stopped_with_or_without_a_person(taught, teacher):
    run = taught(teacher=teacher)
    run.show(SHOWN[7])
    run.close()
    before = recorded(run)
    other = TaughtRun(run.config)
    assert other.go_on(15).replaying
    with pytest.raises(ValueError, match="still replays"):
        other.show(SHOWN[7])
    assert not other.go_on(25).replaying
    other.go_on(10)
    assert other.status().lessons == 1
    other.close()
    np.testing.assert_equal(recorded(run), before)
    assert command(sgimd_run, [*words(replace(run.config, movements=60)), "--resume"]) == 0
    np.testing.assert_equal(recorded(run), before)


@pytest.mark.parametrize(
    ("options", "lesson", "message"),
    [
        ({}, replace(SHOWN[0], trajectory=100 * SHOWN[0].trajectory), "first joint"),
        ({"movements": 30}, SHOWN[0], "--movements 60"),
    ],
)
def test_what_cannot_be_shown_is_refused_and_nothing_happens(taught, options, lesson, message):
    run = taught(**{"teacher": "periodic", **options})
    with pytest.raises(ValueError, match=message):
        run.show(lesson)
    assert (run.status().movements, run.status().lessons) == (30, 0)
    run.close()


def test_a_run_that_is_taught_has_a_person_as_its_teacher(tmp_path, taught):
    config, port = options_of(["--seed", "4", "--port", "9000", "--out", str(tmp_path)])
    assert (config.directory, config["teacher"], port) == (tmp_path / "taught" / "seed-004", "by-hand", 9000)
    run = taught(1)
    run.close()
    config, _ = options_of([str(run.config.directory)])
    assert config == run.config
    shutil.copytree(run.config.directory, tmp_path / "elsewhere")
    for directory, message in ((tmp_path / "elsewhere", "must be called"), (tmp_path, "holds no run")):
        with pytest.raises(ValueError, match=message):
            options_of([str(directory)])
