"""The fishing rod: laws of its mechanics, one landing point for every movement, and noise of its own stream."""

import re
from collections.abc import Callable
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from sgimd_torch.environments.fishing_rod import HOLD, JOINT_RANGES, JOINTS, MODEL, FishingRod
from sgimd_torch.environments.protocol import SimulationError, execute_many
from sgimd_torch.environments.rod_physics import TOP_SPEED, Caster
from sgimd_torch.spaces import Array, Box, Failure, stream

NO_CONTEXT = np.zeros(0)


@pytest.fixture(scope="module")
def rod() -> FishingRod:
    """Without noise; nobody may change its model."""
    return FishingRod(noise=0.0, threads=1)


def movements(n: int, seed: int = 0) -> Array:
    return stream(seed, "movements").random((n, 25))


def cast(rod: FishingRod, theta: Array, context: Array = NO_CONTEXT, seed: int = 0) -> Array:
    return rod.execute(context, theta, stream(seed, "environment"))


def test_six_joints_move_the_arm_and_thirty_the_line(rod: FishingRod) -> None:
    names = [rod.model.joint(i).name for i in range(rod.model.njnt)]
    assert names == [*JOINTS, *(f"line_{k:02}" for k in range(1, 31))]
    assert (rod.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).all()
    across = [rod.model.joint(f"line_{k:02}").axis for k in range(1, 31)]
    assert [float(one @ next_one) for one, next_one in pairwise(across)] == [0.0] * 29
    lengths = [np.linalg.norm(rod.model.body(name).pos) for name in [*(f"line_{k:02}" for k in range(2, 31)), "float"]]
    assert lengths == pytest.approx([0.014] * 30)  # hinges between links keep it
    assert rod.policies.dim == 25


def stepped(rod: FishingRod, theta: Array, wind: float = 0.0) -> Array:
    """``(n_steps, 6)``, positions and velocities of the float, step by step in Python from the start configuration."""
    data, seen = mujoco.MjData(rod.model), list[Array]()
    mujoco.mj_setState(rod.model, data, rod._caster.home, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    step = rod.model.opt.timestep
    for k in range(round((rod.primitive.duration(theta) + HOLD) / step)):
        data.ctrl[:6], data.ctrl[6] = rod.primitive.at(theta, np.array([k * step]))[0], wind
        mujoco.mj_step(rod.model, data)
        mujoco.mj_forward(rod.model, data)  # a step leaves the sensors as they were before it
        seen.append(data.sensordata.copy())
    return np.array(seen)


def test_the_float_lands_where_its_path_first_crosses_the_water(rod: FishingRod) -> None:
    n_landed = 0
    for theta in movements(40):
        track = stepped(rod, theta)[:, :3]
        wet = np.flatnonzero(track[:, 2] <= 0)
        if wet.size:
            above, below = track[wet[0] - 1], track[wet[0]]
            landing = cast(rod, theta)
            shares = (landing - above[:2]) / (below[:2] - above[:2])
            assert shares == pytest.approx(np.full(2, above[2] / (above[2] - below[2])), abs=1e-6)
            n_landed += 1
    assert n_landed > 3


@pytest.mark.parametrize("wind", [0.0, 0.05, -0.05])
def test_a_float_still_in_the_air_at_the_end_flies_on_like_a_stone(wind: float) -> None:
    rod = FishingRod(noise=0.0, max_wind=0.05, threads=1)
    n_flown = 0
    for theta in movements(20):
        theta[-1] = 0.5  # 1.2 s and the hold end on a step
        path = stepped(rod, theta, wind)
        if path[:, 2].min() <= 0:
            continue
        position, velocity = np.split(path[-1], 2)
        flight = max(np.roots([-9.81 / 2, velocity[2], position[2]]))  # z + vz t - g t^2 / 2 = 0
        carried = np.array([wind / 0.02, 0.0]) * flight**2 / 2  # the float has 20 g
        expected = position[:2] + velocity[:2] * flight + carried
        assert cast(rod, theta, np.array([wind])) == pytest.approx(expected, abs=1e-6)
        n_flown += 1
    assert n_flown > 3


def test_a_small_change_of_theta_or_of_the_duration_alone_changes_the_landing_point_little(rod: FishingRod) -> None:
    for theta in movements(40, seed=1):
        longer = theta.copy()
        longer[-1] = theta[-1] - 1e-6
        assert np.abs(cast(rod, longer) - cast(rod, theta)).max() < 1e-4
        other = rod.policies.clip(theta + stream(0, "direction").normal(0, 1e-6, 25))
        assert np.abs(cast(rod, other) - cast(rod, theta)).max() < 1e-3


def test_the_duration_crosses_the_steps_of_the_simulation_without_a_jump(rod: FishingRod) -> None:
    # Pace .5 is 1.2 s, a whole number of steps: just above it the movement takes one step more.
    for theta in movements(20, seed=2):
        below, above = theta.copy(), theta.copy()
        below[-1], above[-1] = 0.5 - 1e-9, 0.5 + 1e-9
        assert np.abs(cast(rod, below) - cast(rod, above)).max() < 1e-6


def test_the_number_of_draws_does_not_depend_on_theta() -> None:
    noisy = FishingRod(noise=0.03, threads=1)
    short, long = movements(2)
    short[-1], long[-1] = 0.0, 1.0
    rngs = [stream(0, "environment"), stream(0, "environment")]
    for theta, rng in zip((short, long), rngs, strict=True):
        noisy.execute(NO_CONTEXT, theta, rng)
    assert rngs[0].bit_generator.state == rngs[1].bit_generator.state
    assert rngs[0].bit_generator.state != stream(0, "environment").bit_generator.state


def test_motor_noise_has_the_stated_deviation_for_each_speed_from_the_first_step_on(rod: FishingRod) -> None:
    noisy, step, n_steps = FishingRod(noise=0.03, threads=1), rod.model.opt.timestep, 25
    taken = 1 - np.exp(-step / rod.model.actuator_dynprm[:6, 0])  # share of a command that a servo takes up in a step
    noises = []
    for row, theta in enumerate(movements(100)):
        servos = noisy.trace(NO_CONTEXT, theta, stream(row, "environment")).states[: n_steps + 1, -6:]
        commands = servos[:-1] + np.diff(servos, axis=0) / taken
        planned = rod.primitive.at(theta, step * np.arange(n_steps + 1))
        noises.append((commands - planned[:-1]) * step / np.abs(np.diff(planned, axis=0)))
    each = np.array(noises).swapaxes(0, 1).reshape(n_steps, -1)  # of 100 movements with 6 joints
    assert each.std(axis=1) == pytest.approx(np.full(n_steps, 0.03), rel=0.15)  # five standard errors
    assert np.corrcoef(each[10], each[11])[0, 1] == pytest.approx(0.96, abs=0.02)


def test_an_arm_that_does_not_move_has_no_noise() -> None:
    still = np.full(25, 0.5)
    noisy = FishingRod(noise=0.1, threads=1)
    assert cast(noisy, still, seed=1) == pytest.approx(cast(noisy, still, seed=2), abs=1e-9)
    assert cast(noisy, still) == pytest.approx(noisy.rest, abs=1e-3)


def test_a_side_wind_carries_a_hanging_float_along_x_alone_and_both_ways_alike() -> None:
    windy = FishingRod(noise=0.0, max_wind=0.05, threads=1)
    still = np.full(25, 0.5)
    calm, right, left = (cast(windy, still, np.array([wind])) for wind in (0.0, 0.05, -0.05))
    assert right[0] - calm[0] > 0.02
    assert abs(right[1] - calm[1]) < 0.3 * (right[0] - calm[0])
    assert left == pytest.approx(right * [-1, 1], abs=1e-6)


def test_no_wind_is_no_context_and_the_world_is_mirrored_left_to_right(rod: FishingRod) -> None:
    windy = FishingRod(noise=0.0, max_wind=0.05, threads=1)
    theta = movements(1)[0]
    assert np.array_equal(cast(windy, theta, np.zeros(1)), cast(rod, theta))
    mirrored = theta.reshape(-1)[:24].reshape(6, 4).copy()
    for joint in ("yaw", "forearm_roll", "wrist_yaw"):  # the others turn about x
        mirrored[JOINTS.index(joint)] = 1 - mirrored[JOINTS.index(joint)]
    assert cast(rod, np.append(mirrored, theta[-1])) == pytest.approx(cast(rod, theta) * [-1, 1], abs=1e-6)


def test_replaying_a_movement_lands_where_executing_it_does(rod: FishingRod) -> None:
    step = rod.model.opt.timestep
    for theta in movements(5):
        theta[-1] = 0.5
        times = step * np.arange(round(1.2 / step) + 1)
        assert rod.replay(times, rod.primitive.at(theta, times)) == pytest.approx(cast(rod, theta), abs=1e-6)


def test_replay_is_without_noise_and_in_the_zero_context() -> None:
    noisy, calm = FishingRod(noise=0.1, max_wind=0.05, threads=1), FishingRod(noise=0.0, threads=1)
    times, trajectory = calm.primitive.trajectory(movements(1)[0])
    assert np.array_equal(noisy.replay(times, trajectory), calm.replay(times, trajectory))


def unstable() -> FishingRod:
    """A line whose hinges have neither damping nor armature."""
    rod = FishingRod(noise=0.0, threads=1)
    rod.model.dof_damping[6:] = 0
    rod.model.dof_armature[6:] = 0
    return rod


@pytest.fixture
def mujoco_log(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings into the working directory


@pytest.mark.usefixtures("mujoco_log")
@pytest.mark.parametrize(("speed", "diverges"), [(2 * TOP_SPEED, False), (4 * TOP_SPEED, True)])
def test_a_line_of_which_only_the_last_hinge_is_too_fast_has_diverged(speed: float, diverges: bool) -> None:
    posture = JOINT_RANGES.low + JOINT_RANGES.sides / 2
    caster = Caster(MODEL, posture, threads=1)
    caster.home[caster.model.nq + caster.model.nv] = speed  # a third of it is left after a step
    (landing,) = caster.cast([np.tile(posture, (3, 1))], np.array([2 * caster.timestep]), np.zeros(1))
    assert np.isnan(landing).tolist() == [diverges] * 2


@pytest.mark.usefixtures("mujoco_log")
def test_a_divergence_names_its_theta_and_the_next_movement_is_the_same_as_without_it(rod: FishingRod) -> None:
    fragile, theta = unstable(), movements(1)[0]
    with pytest.raises(SimulationError, match=rf"diverged.*{re.escape(str(theta[0]))}") as raised:
        cast(fragile, theta)
    assert np.array_equal(raised.value.theta, theta)
    fragile.model.dof_damping[6:] = rod.model.dof_damping[6:]
    fragile.model.dof_armature[6:] = rod.model.dof_armature[6:]
    assert np.array_equal(cast(fragile, theta), cast(rod, theta))


@pytest.mark.usefixtures("mujoco_log")
def test_a_diverged_movement_in_a_batch_is_the_one_that_fails() -> None:
    fragile, still, moving = unstable(), np.full(25, 0.5), movements(1)[0]
    still[-1] = moving[-1] = 0.0  # short enough for the line at rest to stay at rest
    cast(fragile, still)
    batch = np.zeros((2, 0)), np.stack((still, moving)), [stream(i, "environment") for i in (0, 1)]
    assert np.isfinite(fragile.execute_many(*batch)).all(axis=1).tolist() == [True, False]
    assert [isinstance(outcome, Failure) for outcome in execute_many(fragile, *batch)] == [False, True]


def test_nothing_diverges_and_everything_lands_in_reach_even_on_the_corners_of_the_box() -> None:
    noisy, rng = FishingRod(threads=2), stream(0, "corners")
    thetas = np.concatenate([rng.random((150, 25)), rng.integers(0, 2, (50, 25)).astype(float)])
    landings = noisy.execute_many(np.zeros((200, 0)), thetas, [stream(i, "environment") for i in range(200)])
    assert np.isfinite(landings).all()
    assert np.linalg.norm(landings, axis=1).max() < 5


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda rod: FishingRod(noise=-0.1), "noise must be finite and >= 0, got -0.1"),
        (lambda rod: FishingRod(max_wind=np.inf), "max_wind must be finite"),
        (lambda rod: FishingRod(max_wind=-1.0), "max_wind must be finite"),
        (lambda rod: FishingRod(threads=1.5), "threads must be a whole number from 1"),
        (lambda rod: FishingRod(threads=0), "threads must be a whole number from 1"),
        (lambda rod: FishingRod(outcomes=Box.cube(-1, 1, 3)), r"rest, .* must have shape \(..., 3\).* is T in m"),
        (lambda rod: FishingRod(outcomes=Box.cube(5, 6, 2)), "rest, .* must lie in its box"),
        (lambda rod: rod.replay([1.0, 2.0, 3.0], np.zeros((3, 6))), "must start at 0"),
        (lambda rod: rod.replay([0.0, 20.0, 1e5], np.zeros((3, 6))), "lasts 60 s at most"),
        (lambda rod: rod.execute(NO_CONTEXT, np.full(25, 0.5), 0), "was the seed passed"),
        (lambda rod: rod.execute_many(np.zeros((1, 0)), np.full((1, 25), 0.5), [0]), "was the seed passed"),
    ],
)
def test_what_makes_no_sense_is_refused(rod: FishingRod, call: Callable[[FishingRod], object], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        call(rod)
