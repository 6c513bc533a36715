"""The planar arm as a MuJoCo model has the geometry of the arm itself."""

import mujoco
import numpy as np

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.spaces import stream
from sgimd_torch.teach.led import arm_led, planar_model


def test_its_end_is_where_the_arm_ends_for_any_theta():
    arm, rng = PlanarArm(5), stream(0, "thetas")
    model = arm_led(arm).model
    data = mujoco.MjData(model)
    for _ in range(20):
        theta = arm.policies.sample(rng)
        data.qpos[:] = arm.angles(theta)
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("end").xpos, [*arm.execute(np.zeros(0), theta, rng), 0], atol=1e-12)


def test_links_may_differ_in_length():
    model = planar_model([0.5, 0.3, 0.2])
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose([data.body(f"link_{k}").xpos[0] for k in range(3)], [0, 0.5, 0.8])
    np.testing.assert_allclose(data.site("end").xpos, [1, 0, 0])
