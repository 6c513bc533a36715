"""Demonstrations on disk: what is saved is loaded again, what is broken is refused by name, and what is shipped."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgimd_torch.demonstrations import SHIPPED, load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.fit import misfit_of
from sgimd_torch.environments.fishing_rod import JOINT_RANGES, FishingRod
from sgimd_torch.runs.tasks.robots import fishing_rod
from sgimd_torch.runs.tasks.taught import demonstrations_of
from sgimd_torch.spaces import Array, Demonstration, stream


def some(n: int = 3, n_joints: int = 2, outcome_dim: int = 2, context_dim: int = 0) -> list[Demonstration]:
    """Recordings of 2, 3, 4 ... samples."""
    rng = stream(0, "recordings")
    return [
        Demonstration(
            rng.normal(size=context_dim),
            np.arange(k + 2) / 50,
            rng.normal(size=(k + 2, n_joints)),
            rng.normal(size=outcome_dim),
        )
        for k in range(n)
    ]


def assert_same(loaded: list[Demonstration], saved: list[Demonstration]) -> None:
    assert len(loaded) == len(saved)
    for one, other in zip(loaded, saved, strict=True):
        for name in ("context", "times", "trajectory", "outcome"):
            ours, theirs = getattr(one, name), getattr(other, name)
            assert ours.dtype == np.float64
            assert ours.shape == theirs.shape
            assert np.array_equal(ours, theirs)


def test_what_is_saved_is_loaded_again_exactly(tmp_path: Path) -> None:
    for context_dim in (0, 2):
        saved = some(context_dim=context_dim)
        save_demonstrations(tmp_path / "mine.npz", saved)
        assert_same(load_demonstrations(tmp_path / "mine.npz"), saved)
        assert_same(load_demonstrations(str(tmp_path / "mine.npz"), n_joints=2, outcome_dim=2), saved)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.npz"]


def fields() -> dict[str, np.ndarray]:
    """Two recordings of 2 and 3 samples, as they stand in a file."""
    return {
        "lengths": np.array([2, 3]),
        "times": np.array([0.0, 0.02, 0.0, 0.02, 0.04]),
        "trajectories": np.zeros((5, 6)),
        "outcomes": np.zeros((2, 2)),
        "contexts": np.zeros((2, 0)),
    }


def changed(name: str, value: object) -> Callable[[dict[str, np.ndarray]], None]:
    return lambda these: these.update({name: np.array(value)})


def overflowing(these: dict[str, np.ndarray]) -> None:
    """The sum of the lengths is said to be 5, as it is."""
    lengths = np.array([2**62, 2**62, 2**62, 2**62 + 5])
    these.update(lengths=lengths, outcomes=np.zeros((4, 2)), contexts=np.zeros((4, 0)))


def shuffled(these: dict[str, np.ndarray]) -> None:
    these["times"][[3, 4]] = these["times"][[4, 3]]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (changed("lengths", [2, 4]), "truncated"),
        (changed("lengths", [-1, 6]), "fewer than 2"),
        (overflowing, "lengths"),
        (changed("lengths", [[2, 3]]), "axes"),
        (changed("lengths", np.zeros(0, dtype=int)), "no demonstration"),
        (changed("outcomes", np.zeros((3, 2))), "3 outcomes"),
        (changed("trajectories", np.zeros((4, 6))), "truncated"),
        (
            changed("trajectories", np.full((5, 6), np.nan)),
            r"recording 0: trajectory .* entry \[0, 0\] is nan \(and 11 more\)",
        ),
        (changed("outcomes", [[0.0, np.inf], [0.0, 0.0]]), r"recording 0: outcome .* entry \[1\] is inf;"),
        (changed("times", [0.0, 0.02, 0.0, 0.02, 0.02]), "recording 1: times .* must increase"),
        (shuffled, "shuffled"),
        (changed("trajectories", np.full((5, 6), "far")), "trajectories must be numbers"),
        (lambda these: these.pop("outcomes"), "lacks"),
    ],
)
def test_a_file_that_cannot_be_right_is_refused_by_name(
    tmp_path: Path, spoil: Callable[[dict[str, np.ndarray]], object], message: str
) -> None:
    these = fields()
    spoil(these)
    np.savez(tmp_path / "bad.npz", **these)
    with pytest.raises(ValueError, match=message) as raised:
        load_demonstrations(tmp_path / "bad.npz")
    assert "bad.npz" in str(raised.value)


def test_recordings_of_another_precision_are_given_as_float64(tmp_path: Path) -> None:
    these = fields()
    these.update(trajectories=np.ones((5, 6), dtype=np.float32), outcomes=np.ones((2, 2), dtype=">f8"))
    np.savez(tmp_path / "single.npz", **these)
    for recording in load_demonstrations(tmp_path / "single.npz"):
        assert recording.trajectory.dtype == recording.outcome.dtype == np.float64


@pytest.mark.parametrize(
    ("robot", "message"),
    [({"n_joints": 7}, "6 joints, the robot has 7"), ({"outcome_dim": 3}, "outcome"), ({"context_dim": 1}, "context")],
)
def test_recordings_of_another_robot_are_refused(robot: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_demonstrations(**robot)


def spoilt(name: str, value: Array) -> list[Demonstration]:
    good = some()
    parts = {part: getattr(good[1], part) for part in ("context", "times", "trajectory", "outcome")}
    return [good[0], Demonstration(**(parts | {name: value})), good[2]]


@pytest.mark.parametrize(
    "saved",
    [
        [],
        spoilt("trajectory", np.zeros((3, 5))),
        spoilt("outcome", np.zeros(3)),
        spoilt("context", np.zeros(1)),
    ],
)
def test_what_could_not_be_loaded_is_not_saved_and_the_old_file_stays(
    tmp_path: Path, saved: list[Demonstration]
) -> None:
    path = tmp_path / "mine.npz"
    save_demonstrations(path, some())
    with pytest.raises(ValueError):  # noqa: PT011 - of numpy's, too, where recordings do not fit together
        save_demonstrations(path, saved)
    assert_same(load_demonstrations(path), some())
    assert [file.name for file in tmp_path.iterdir()] == ["mine.npz"]


# What is shipped: the simulated recordings of demonstrator 3, section 5.3.

RECORDINGS = load_demonstrations()


def test_the_shipped_file_holds_127_recordings_of_this_robot_at_50_hertz() -> None:
    assert SHIPPED.name == "demonstrator_3.npz"
    assert len(load_demonstrations(n_joints=6, outcome_dim=2, context_dim=0)) == 127
    for recording in RECORDINGS:
        assert np.diff(recording.times) == pytest.approx(0.02)
        assert 0.5 < recording.times[-1] < 3


def test_every_joint_is_led_monotonically_inside_its_range() -> None:
    for recording in RECORDINGS:
        assert JOINT_RANGES.contains(recording.trajectory).all()
        steps = np.diff(recording.trajectory, axis=0)
        assert ((steps >= 0).all(axis=0) | (steps <= 0).all(axis=0)).all()
        assert recording.trajectory[0] == pytest.approx((JOINT_RANGES.low + JOINT_RANGES.high) / 2)


def test_no_recording_is_exactly_a_motor_primitive() -> None:
    rod = FishingRod(noise=0.0, threads=1)
    translate = rod.primitive.correspondence
    misfits = [misfit_of(rod, translate(shown.times, shown.trajectory), shown) for shown in RECORDINGS]
    assert np.mean(misfits) > 1e-3
    assert np.max(misfits) < 0.2  # but the correspondence can translate all of them


def test_a_run_refuses_recordings_in_degrees(tmp_path: Path) -> None:
    save_demonstrations(tmp_path / "deg.npz", [replace(RECORDINGS[0], trajectory=np.rad2deg(RECORDINGS[0].trajectory))])
    with pytest.raises(ValueError, match=r"deg\.npz: recording 0 cannot be translated: .* is it in degrees"):
        demonstrations_of(fishing_rod(), tmp_path / "deg.npz")


def test_the_recorded_landing_points_are_those_of_the_recorded_trajectories() -> None:
    rod = FishingRod(noise=0.0, threads=1)
    for recording in RECORDINGS:
        assert rod.replay(recording.times, recording.trajectory) == pytest.approx(recording.outcome, abs=1e-6)
