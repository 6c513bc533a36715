"""Position servos for the joints of a model that has motors, or no actuators at all.

model = serve(spec, spec.compile(), joints_to_serve(...)); a command of an actuator is then a position to go to.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.extras.models.places import is_servo, joint_of, joints_above, movable, pulled
from sgimd_torch.spaces import Array, stream

FREQUENCY: Final = 30.0  # rad/s, natural frequency of a servo
SHARE: Final = 0.5  # share of the force of a joint that its commands may ask for to accelerate it
DAMPED: Final = 0.8  # share that they may ask for against damping; the greatest speed is not that of the acceleration
SAG: Final = 0.01  # rad or m, largest error of a servo that holds a joint against friction and weight
_STIFFEST: Final = 0.5  # largest product of an undamped servo's natural frequency and the timestep; 2 is unstable
_POSTURES: Final = 50  # number of random postures that measure inertias and loads


def joints_to_serve(model: mujoco.MjModel, servos: str, joints: Sequence[str], *, alone: bool) -> list[int]:
    """Joints that get a position servo; see ``servos`` of `MujocoRobot`.

    If nothing acts on a joint, the robot is the tree of bodies that has one of ``joints``, else the largest tree. A
    model that is ``alone`` has nothing but the robot.
    """
    able, acts_on = movable(model), [joint_of(model, k) for k in range(model.nu)]
    if servos == "file":
        return []
    if servos == "auto" and model.nu:
        served = {acts_on[k] for k in range(model.nu) if is_servo(model, k)}
        return [joint for joint in dict.fromkeys(acts_on) if joint in able and joint not in served]
    pulled_by = {k for _, body in pulled(model) for k in joints_above(model, body)}
    if chosen := [k for k in able if k in acts_on or k in pulled_by]:
        return chosen
    root_of = {k: int(model.body_rootid[model.jnt_bodyid[k]]) for k in able}
    sizes = Counter(root_of.values())
    wanted = {root for k, root in root_of.items() if model.joint(k).name in joints}
    wanted = wanted or {root for root, size in sizes.items() if alone or size == max(sizes.values())}
    return [k for k, root in root_of.items() if root in wanted]


def serve(
    spec: mujoco.MjSpec, model: mujoco.MjModel, chosen: Sequence[int]
) -> tuple[mujoco.MjModel, dict[str, float], dict[str, float]]:
    """Give position servos to ``chosen`` joints, in place of their motors, and compile; with speeds and accelerations.

    As those of an arm that one can buy, the servos know the weight of the links: it is compensated. A servo moves the
    greatest inertia of its joint with the natural frequency, and outweighs damping and friction. The force of a motor
    stays within its limits, and so do speeds and accelerations. Nothing else may pull the arm: constraints to mocap
    bodies go.
    """
    names = [model.joint(k).name for k in chosen]
    if not names:
        raise ValueError("it has no joint that turns or slides")
    bodies = {body.name: body for body in spec.bodies}
    for k in range(1, model.nbody):
        above = joints_above(model, k)
        if above and {*above} <= {*chosen}:  # nothing passive below it
            bodies[model.body(k).name].gravcomp = 1
    for k in reversed([k for k, body in pulled(model) if {*joints_above(model, body)} & {*chosen}]):
        spec.delete(spec.equalities[k])
    mujoco.mj_forward(model, data := mujoco.MjData(model))
    motors = dict[str, mujoco.MjsActuator]()
    for k, actuator in reversed([*enumerate(spec.actuators)]):
        if joint_of(model, k) in chosen:
            if actuator.target in motors:
                spec.delete(motors[actuator.target])
            motors[actuator.target], joint = actuator, spec.joint(actuator.target)
            if (effort := _effort(model, k)) and not model.jnt_actfrclimited[joint_of(model, k)]:
                joint.actfrcrange, joint.actfrclimited = [-effort, effort], 1
        elif joint_of(model, k) is None and {*_pulled_by(data, k)} <= {*model.jnt_dofadr[[*chosen]].tolist()}:
            spec.delete(actuator)  # a tendon or muscle of joints that have servos
    for name in names:
        spec.joint(name).actgravcomp = 1
    for key in spec.keys:  # its commands are those of motors
        key.ctrl, key.act = [], []
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # stable with the damping of light joints
    compensated = spec.compile()
    inertias, loads = _burdens(compensated, chosen)
    speeds, accelerations = dict[str, float](), dict[str, float]()
    for name, k in zip(names, chosen, strict=True):
        dof = int(model.jnt_dofadr[k])
        inertia, damping = inertias[dof], float(compensated.dof_damping[dof])
        stiffness = max(inertia * FREQUENCY**2, damping * FREQUENCY / 2, loads[dof] / SAG)
        timestep = compensated.opt.timestep  # unstable from (4 inertia / timestep + 2 damping) / timestep on
        stiffness = min(stiffness, _STIFFEST**2 * (inertia / timestep + damping / 2) / timestep)
        if compensated.jnt_actfrclimited[k]:
            force = float(np.abs(compensated.jnt_actfrcrange[k]).max())
            speeds[name], accelerations[name] = DAMPED * force / damping if damping else np.inf, SHARE * force / inertia
        servo = motors.get(name) or spec.add_actuator(name=name, target=name)
        servo.trntype, servo.gear, servo.ctrllimited, servo.forcelimited = mujoco.mjtTrn.mjTRN_JOINT, np.eye(6)[0], 0, 0
        servo.dyntype, servo.actlimited = mujoco.mjtDyn.mjDYN_NONE, 0
        servo.set_to_position(kp=stiffness, kv=max(0.0, 2 * np.sqrt(stiffness * inertia) - damping))
    return spec.compile(), speeds, accelerations


def _pulled_by(data: mujoco.MjData, actuator: int) -> list[int]:
    """Degrees of freedom that an actuator acts on in a state; [-1] if there are none."""
    row = slice(data.moment_rowadr[actuator], data.moment_rowadr[actuator] + data.moment_rownnz[actuator])
    return data.moment_colind[row][data.actuator_moment[row] != 0].tolist() or [-1]


def _effort(model: mujoco.MjModel, actuator: int) -> float:
    """Largest force (N) or torque (N m) of a motor on its joint, 0 if it is not limited."""
    gear, forces = abs(model.actuator_gear[actuator, 0]), list[float]()
    if model.actuator_ctrllimited[actuator] and model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED:
        forces.append(np.abs(model.actuator_ctrlrange[actuator] * model.actuator_gainprm[actuator, 0]).max())
    if model.actuator_forcelimited[actuator]:
        forces.append(np.abs(model.actuator_forcerange[actuator]).max())
    return float(gear * min(forces, default=0.0))


def _burdens(model: mujoco.MjModel, chosen: Sequence[int]) -> tuple[Array, Array]:
    """``(nv,)`` greatest inertia of each degree of freedom, and greatest load that is not compensated, friction too."""
    data, inertias, loads = mujoco.MjData(model), np.zeros(model.nv), np.zeros(model.nv)
    for posture in range(_POSTURES):
        shares = stream(0, "postures", posture).random(model.njnt)
        for k in chosen:
            low, high = model.jnt_range[k] if model.jnt_limited[k] else (-np.pi, np.pi)
            data.qpos[model.jnt_qposadr[k]] = low + shares[k] * (high - low)
        mujoco.mj_forward(model, data)
        loads = np.maximum(loads, np.abs(data.qfrc_bias - data.qfrc_gravcomp - data.qfrc_spring))
        inertias = np.maximum(inertias, data.M[model.M_rowadr + model.M_rownnz - 1])  # the diagonal ends each row
    return inertias, loads + model.dof_frictionloss
