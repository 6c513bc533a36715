"""A taught run without a page: lessons enter the run, which goes on, also without anybody."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.options.command_line import main as run
from sgimd_torch.options.config import Config, words
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.signals import command
from sgimd_torch.runs.tasks.robots import arm_demonstrations
from sgimd_torch.teach.by_hand import BY_HAND, ByHand
from sgimd_torch.teach.command import main, options_of
from sgimd_torch.teach.taught import TaughtRun

SHOWN = arm_demonstrations(PlanarArm())


@pytest.fixture
def taught(tmp_path):
    """Runs on the small arm, to be closed; ``teacher`` is None for a learner to whom nobody comes."""

    def open_run(made=30, **options):
        given = {"algorithm": "sgim-d", "teacher": "by-hand", "movements": 300, "evaluate_at": (20,), **options}
        settings = {name: value for name, value in given.items() if value is not None}
        fixed = {"name": "taught", "out": tmp_path, "repeats": 0, "environment": "planar-arm-7"}
        learning = TaughtRun(Config.from_settings({**settings, **fixed}))
        learning.go_on(made)
        return learning

    return open_run


def lived(taught):
    """What was recorded of a run, movement by movement."""
    found = read_run(taught.config.directory)
    return [found.contexts, found.thetas, found.goals, found.outcomes, found.origin, found.demonstration]


def assert_same(one, other, n=None):
    for ours, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(ours[:n], theirs[:n])


def test_a_lesson_is_answered_at_once_and_the_map_is_better_where_it_landed(taught):
    learning = taught()
    before = learning.status()
    assert (before.movements, before.lessons) == (30, 0)
    after = learning.show(SHOWN[120])
    assert (after.movements, after.lessons) == (30 + learning.config["social.repeats"], 1)
    box = learning.parts.environment.outcomes
    column, row = ((SHOWN[120].outcome - box.low) / box.sides * after.chart.distances.shape[0]).astype(int)
    assert after.chart.distances[row, column] < 0.05 < before.chart.distances[row, column]
    learning.close()
    found = read_run(learning.config.directory)
    assert set(found.origin[30:]) == {"imitate"}
    np.testing.assert_array_equal(found.demonstrations[found.demonstration[30]].trajectory, SHOWN[120].trajectory)


def test_a_teacher_of_the_run_shows_the_same_whether_or_not_a_person_does():
    class Counting:
        def offer(self, index, memory):
            return SHOWN[index]

    hand, offered = ByHand(teacher=Counting()), []
    for index in range(4):
        if index == 2:
            hand.give(SHOWN[50])
        offered.append((hand.offer(index, None), hand.who))
    assert offered == [
        (SHOWN[0], "teacher"),
        (SHOWN[1], "teacher"),
        (SHOWN[50], BY_HAND),
        (SHOWN[3], "teacher"),
    ]


@pytest.mark.parametrize("teacher", ["by-hand", "periodic"])
def test_it_goes_on_where_it_was_stopped_with_or_without_a_person(taught, teacher):
    learning = taught(teacher=teacher)
    learning.show(SHOWN[7])
    learning.close()
    before = lived(learning)
    other = TaughtRun(learning.config)
    assert other.go_on(15).replaying
    with pytest.raises(ValueError, match="still replays"):
        other.show(SHOWN[7])
    assert not other.go_on(25).replaying
    other.go_on(10)
    assert other.status().lessons == 1
    other.close()
    assert_same(before, lived(learning), 40)
    assert command(run, [*words(replace(learning.config, movements=60)), "--resume"]) == 0
    assert_same(before, lived(learning), 40)


@pytest.mark.parametrize(
    ("options", "lesson", "message"),
    [
        ({}, replace(SHOWN[0], trajectory=100 * SHOWN[0].trajectory), "first joint"),
        ({"movements": 30}, SHOWN[0], "--movements 60"),
    ],
)
def test_what_cannot_be_shown_is_refused_and_nothing_happens(taught, options, lesson, message):
    learning = taught(**{"teacher": "periodic", **options})
    with pytest.raises(ValueError, match=message):
        learning.show(lesson)
    assert (learning.status().movements, learning.status().lessons) == (30, 0)
    learning.close()


@pytest.mark.parametrize("algorithm", ["sagg-riac", "sgim-im"])
def test_a_learner_that_nobody_can_teach_by_hand_is_refused_before_anything_is_written(tmp_path, capsys, algorithm):
    words = ["--environment", "planar-arm-7", "--algorithm", algorithm, "--out", str(tmp_path)]
    assert command(main, words) == 2
    assert f"{algorithm} cannot be taught by hand" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


def test_a_task_without_anything_to_lead_says_why(capsys):
    assert command(main, ["--environment", "experiments.toys:toss"]) == 2
    assert "Toy cannot be led by the hand" in capsys.readouterr().err


def test_a_run_that_is_taught_has_a_person_as_its_teacher(tmp_path, taught):
    config, port = options_of(["--seed", "4", "--port", "9000", "--out", str(tmp_path)])
    assert (config.directory, config["teacher"], port) == (tmp_path / "taught" / "seed-004", "by-hand", 9000)
    learning = taught(1)
    learning.close()
    config, _ = options_of([str(learning.config.directory)])
    assert config == learning.config
    moved = tmp_path / "elsewhere"
    shutil.copytree(learning.config.directory, moved)
    with pytest.raises(ValueError, match="must be called"):
        options_of([str(moved)])
    with pytest.raises(ValueError, match="holds no run"):
        options_of([str(tmp_path)])
