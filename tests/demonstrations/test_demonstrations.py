"""Demonstrations on disk: what is saved is loaded again, what is broken is refused by name, and what is shipped."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sgimd_torch.demonstrations import SHIPPED, load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.fit import misfit_of
from sgimd_torch.environments.fishing_rod import JOINT_RANGES, FishingRod
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.tasks.rod import fishing_rod
from sgimd_torch.tasks.taught import demonstrations_of

FIELDS = ("context", "times", "trajectory", "outcome")
DIMENSIONS = st.integers(0, 3), st.integers(1, 4), st.integers(1, 3)


@st.composite
def recordings(draw):
    """Recordings of one robot, which differ in length."""
    context_dim, n_joints, outcome_dim = map(draw, DIMENSIONS)
    numbers = st.floats(-1e100, 1e100)

    def recording(n):
        times = np.cumsum(draw(arrays(float, n, elements=st.floats(1e-3, 1e3))))
        shapes = context_dim, (n, n_joints), outcome_dim
        context, trajectory, outcome = (draw(arrays(float, shape, elements=numbers)) for shape in shapes)
        return Demonstration(context, times, trajectory, outcome)

    return [recording(n) for n in draw(st.lists(st.integers(2, 5), min_size=1, max_size=4))]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(recordings())
def test_what_is_saved_is_loaded_again_exactly(tmp_path_factory, saved):
    path = tmp_path_factory.getbasetemp() / "saved.npz"
    save_demonstrations(path, saved)
    context_dim, n_joints, outcome_dim = len(saved[0].context), saved[0].trajectory.shape[1], len(saved[0].outcome)
    loaded = load_demonstrations(path, n_joints=n_joints, outcome_dim=outcome_dim, context_dim=context_dim)
    for ours, theirs in zip(loaded, saved, strict=True):
        for name in FIELDS:
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), strict=True)


def changed(name, value):
    return lambda fields: fields.update({name: np.array(value)})


def overflow(fields):
    """The sum of the lengths is said to be 5, as it is."""
    lengths = np.array([2**62, 2**62, 2**62, 2**62 + 5])
    fields.update(lengths=lengths, outcomes=np.zeros((4, 2)), contexts=np.zeros((4, 0)))


def shuffle(fields):
    fields["times"][[3, 4]] = fields["times"][[4, 3]]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (changed("lengths", [2, 4]), "truncated"),
        (changed("lengths", [-1, 6]), "fewer than 2"),
        (overflow, "lengths"),
        (changed("lengths", [[2, 3]]), "axes"),
        (changed("lengths", np.zeros(0, dtype=int)), "no demonstration"),
        (changed("outcomes", np.zeros((3, 2))), "3 outcomes"),
        (changed("trajectories", np.zeros((4, 6))), "truncated"),
        (
            changed("trajectories", np.full((5, 6), np.nan)),
            r"recording 0: trajectory .* \[0, 0\] is nan \(and 11 more\)",
        ),
        (changed("outcomes", [[0.0, np.inf], [0.0, 0.0]]), r"recording 0: outcome .* entry \[1\] is inf;"),
        (changed("times", [0.0, 0.02, 0.0, 0.02, 0.02]), "recording 1: times .* must increase"),
        (shuffle, "shuffled"),
        (changed("trajectories", np.full((5, 6), "far")), "trajectories must be numbers"),
        (lambda fields: fields.pop("outcomes"), "lacks"),
    ],
)
def test_a_file_that_cannot_be_right_is_refused_by_name(tmp_path, spoil, message):
    fields = {
        "lengths": np.array([2, 3]),
        "times": np.array([0.0, 0.02, 0.0, 0.02, 0.04]),
        "trajectories": np.zeros((5, 6), dtype=np.float32),
        "outcomes": np.zeros((2, 2), dtype=">f8"),
        "contexts": np.zeros((2, 0)),
    }
    np.savez(tmp_path / "bad.npz", **fields)
    for recording in load_demonstrations(tmp_path / "bad.npz"):
        assert recording.trajectory.dtype == recording.outcome.dtype == np.float64  # from any precision
    spoil(fields)
    np.savez(tmp_path / "bad.npz", **fields)
    with pytest.raises(ValueError, match=f"bad.npz.*{message}"):
        load_demonstrations(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("robot", "message"),
    [({"n_joints": 7}, "6 joints, the robot has 7"), ({"outcome_dim": 3}, "outcome"), ({"context_dim": 1}, "context")],
)
def test_recordings_of_another_robot_are_refused(robot, message):
    with pytest.raises(ValueError, match=message):
        load_demonstrations(**robot)


@pytest.mark.parametrize(
    "other", [None, {"trajectory": np.zeros((3, 5))}, {"outcome": np.zeros(3)}, {"context": [0.0]}]
)
def test_what_could_not_be_loaded_is_not_saved_and_the_old_file_stays(tmp_path, other):
    path, good = tmp_path / "mine.npz", Demonstration(np.zeros(0), np.arange(3.0), np.zeros((3, 2)), np.zeros(2))
    save_demonstrations(path, [good])
    before = path.read_bytes()
    with pytest.raises(ValueError):  # noqa: PT011 - of numpy's, too, where recordings do not fit together
        save_demonstrations(path, [] if other is None else [good, replace(good, **other)])
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


# What is shipped: the simulated recordings of demonstrator 3, section 5.3.

RECORDINGS = load_demonstrations()


def test_the_shipped_file_holds_127_recordings_at_50_hertz_which_lead_every_joint_monotonically_inside_its_range():
    assert SHIPPED.name == "demonstrator_3.npz"
    assert len(load_demonstrations(n_joints=6, outcome_dim=2, context_dim=0)) == 127
    for recording in RECORDINGS:
        assert np.diff(recording.times) == pytest.approx(0.02)
        assert 0.5 < recording.times[-1] < 3
        assert JOINT_RANGES.contains(recording.trajectory).all()
        steps = np.diff(recording.trajectory, axis=0)
        assert ((steps >= 0).all(axis=0) | (steps <= 0).all(axis=0)).all()
        assert recording.trajectory[0] == pytest.approx((JOINT_RANGES.low + JOINT_RANGES.high) / 2)


def test_the_landing_points_are_those_of_the_trajectories_of_which_none_is_exactly_a_motor_primitive():
    rod, misfits = FishingRod(noise=0.0, threads=1), []
    for recording in RECORDINGS:
        assert rod.replay(recording.times, recording.trajectory) == pytest.approx(recording.outcome, abs=1e-6)
        theta = rod.primitive.correspondence(recording.times, recording.trajectory)
        misfits.append(misfit_of(rod, theta, recording))
    assert np.mean(misfits) > 1e-3
    assert np.max(misfits) < 0.2  # but the correspondence can translate all of them


def test_the_misfit_is_the_root_mean_square_in_radians():
    rod = FishingRod(noise=0.0, threads=1)
    theta = rod.policies.sample(stream(1, "theta"))
    times, trajectory = rod.primitive.trajectory(theta)
    off = trajectory + np.array([0.3, 0, 0, 0, 0, 0])  # one of six joints, throughout
    assert misfit_of(rod, theta, Demonstration(np.zeros(0), times + 7, off, np.zeros(2))) == pytest.approx(
        0.3 / np.sqrt(6)
    )


def test_a_run_refuses_recordings_in_degrees(tmp_path):
    save_demonstrations(tmp_path / "deg.npz", [replace(RECORDINGS[0], trajectory=np.rad2deg(RECORDINGS[0].trajectory))])
    with pytest.raises(ValueError, match=r"deg\.npz: recording 0 cannot be translated: .* is it in degrees"):
        demonstrations_of(fishing_rod(), tmp_path / "deg.npz")
