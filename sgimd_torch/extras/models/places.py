"""What a text such as "site:tip:xy" names in a model of MuJoCo, and what its actuators act on.

place, = outcome_places(model, "site:tip:xy"); place.read(data)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.spaces import Array, Box
from sgimd_torch.texts import NUMBER, did_you_mean

_COUNTS: Final = {"site": "nsite", "body": "nbody", "geom": "ngeom", "joint": "njnt"}
_AXES: Final = "xyz"
UNITS: Final = {int(mujoco.mjtJoint.mjJNT_HINGE): "rad", int(mujoco.mjtJoint.mjJNT_SLIDE): "m"}
"""Unit of the position of each kind of joint that turns or slides."""
_FREE: Final = int(mujoco.mjtJoint.mjJNT_FREE)
_ON_JOINT: Final = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}


@dataclass(frozen=True)
class Place:
    """Coordinates of a site, a body or a geom (m), or the position of a joint (rad or m).

    Args:
        kind: "site", "body", "geom" or "joint".
        name: name in the model.
        number: index in the model.
        axes: indices of the coordinates; () for a joint.
        unit: "m" or "rad".
        address: index of the position of a joint in ``qpos``.
    """

    kind: str
    name: str
    number: int
    axes: tuple[int, ...] = ()
    unit: str = "m"
    address: int = 0

    def read(self, data: mujoco.MjData) -> Array:
        """The coordinates now."""
        if self.kind == "joint":
            return data.qpos[[self.address]]
        return self.position(data)[list(self.axes)]

    def position(self, data: mujoco.MjData) -> Array:
        """``(3,)`` m, the position now; of a joint, its anchor."""
        places = {"site": data.site_xpos, "body": data.xpos, "geom": data.geom_xpos, "joint": data.xanchor}
        return places[self.kind][self.number].copy()

    @property
    def names(self) -> list[str]:
        """Name of each coordinate."""
        return [f"{self.name} {_AXES[axis]}" for axis in self.axes] or [self.name]


def outcome_places(model: mujoco.MjModel, outcome: str) -> list[Place]:
    """The places that ``outcome`` lists, such as "site:tip:xy,body:cup".

    Raises:
        ValueError: the text names nothing of the model, or both lengths and angles.
    """
    if not outcome:
        known = [f"{kind}:{name}" for kind in _COUNTS for name in _names(model, kind) if name != "world"]
        raise ValueError(f"outcome is missing: it names what goals are about, such as {', '.join(known[:20])}")
    places = []
    for text in outcome.split(","):
        kind, _, name = text.strip().partition(":")
        axes = ""
        head, _, tail = name.rpartition(":")
        known = _names(model, kind)
        if head and name not in known and (head in known or {*tail} <= {*_AXES}):  # a name may have colons, too
            name, axes = head, tail
        place = find(model, f"outcome {text!r}", kind, name)
        if not set(axes) <= set(_AXES if kind != "joint" else "") or len(set(axes)) < len(axes):
            raise ValueError(f"outcome {text!r}: {axes!r} are no axes; write some of x, y and z, for a joint nothing")
        axes = axes or _AXES if kind != "joint" else ""
        places.append(replace(place, axes=tuple(map(_AXES.index, axes))))
    measured = [(place.kind, place.number, axis) for place in places for axis in place.axes or [0]]
    if len({*measured}) < len(measured):
        raise ValueError(f"outcome {outcome!r} names a coordinate twice; leave one out")
    if len({place.unit for place in places}) > 1:
        raise ValueError(f"outcome {outcome!r} mixes lengths (m) and angles (rad); a goal needs one unit")
    return places


def context_box(model: mujoco.MjModel, context: str) -> tuple[Box, list[int]]:
    """C, and the index in ``qpos`` of each of its dimensions.

    Args:
        model: model of the robot and its objects.
        context: list such as "body:cup:x:0.1:0.3,joint:door:0:1": for each dimension an axis of a free body, or a
            joint, then its lowest and highest initial position; "" for none.

    Raises:
        ValueError: the text names nothing of the model, a body is not free, or a number is wrong.
    """
    sides, names, units, addresses = list[list[float]](), list[str](), list[str](), list[int]()
    for text in filter(None, context.split(",")):
        kind, _, rest = text.strip().partition(":")
        what, words = f"context {text!r}", rest.rsplit(":", 3 if kind == "body" else 2)  # a name may have colons, too
        if (kind, len(words)) not in (("body", 4), ("joint", 3)):
            raise ValueError(f"{what}: write body:NAME:AXIS:LOW:HIGH for a free body, or joint:NAME:LOW:HIGH")
        place, (low, high) = find(model, what, kind, words[0]), words[-2:]
        address, name = place.address, " ".join(words[:-2])
        if kind == "body":
            joint = int(model.body_jntadr[place.number])
            if joint < 0 or model.jnt_type[joint] != _FREE or words[1] not in tuple(_AXES):
                raise ValueError(f"{what}: only a body with a free joint has an axis x, y or z; else write joint:NAME")
            address = int(model.jnt_qposadr[joint]) + _AXES.index(words[1])
        try:
            sides.append([NUMBER.of(low), NUMBER.of(high)])
            Box(*np.array(sides[-1:]).T)
        except ValueError:
            raise ValueError(f"{what}: {low} and {high} must be two numbers, the lower one first") from None
        names.append(name if place.unit == "m" else f"{name} ({place.unit})")
        units.append(place.unit)
        addresses.append(address)
    if len({*addresses}) < len(addresses):
        raise ValueError(f"context {context!r} names a position twice; leave one out")
    lows, highs = np.array(sides).reshape(-1, 2).T
    return Box(lows, highs, tuple(names), "m" if {*units} == {"m"} else ""), addresses


def commands_box(model: mujoco.MjModel, joints: Sequence[str], start: Array) -> tuple[Box, list[int], list[str]]:
    """Ranges of the commands of a movement, the actuator of each command, and remarks.

    Args:
        model: model of the robot.
        joints: names of joints, or of actuators that act on no joint; () for all actuators.
        start: ``(nu,)`` commands that hold the start; no joint turns by more than half a turn from there.

    Raises:
        ValueError: a joint does not exist or has no actuator, or a command has no range.
    """
    moves = [joint_of(model, k) for k in range(model.nu)]
    names = [model.actuator(k).name if j is None else model.joint(j).name for k, j in enumerate(moves)]
    for name, n in Counter(joints).items():
        if n > 1:
            raise ValueError(f"joints names {name!r} {n} times; one command moves a joint")
        if name not in names:
            hint = did_you_mean(name, names) or f"; known are {', '.join(dict.fromkeys(names))}"
            raise ValueError(f"joints: {name!r} is no joint with an actuator{hint}")
    chosen = [k for name in joints or dict.fromkeys(names) for k in range(model.nu) if names[k] == name]
    sides, endless, remarks = list[Array](), list[str](), list[str]()
    if not joints:  # a slide without a range, such as that of a base, stays where it is
        held = [k for k in chosen if not model.actuator_ctrllimited[k] and slides_on(model, moves[k])]
        chosen = [k for k in chosen if k not in held]
        sliding = ", ".join(names[k] for k in held)
        advice = "write ranges into the model, or command forces: --environment.servos file"
        remarks += [f"slides without a range stay where they are: {sliding}; {advice}"] * bool(held)
    for k in chosen:
        joint, side = moves[k], model.actuator_ctrlrange[k]
        if not model.actuator_ctrllimited[k]:
            if joint is None or not is_servo(model, k):
                raise ValueError(f"actuator {model.actuator(k).name!r} has no ctrlrange; write one into the model")
            if slides_on(model, joint):
                raise ValueError(f"joint {names[k]!r} slides without a range; write one into the model")
            side = model.jnt_range[joint] if model.jnt_limited[joint] else np.array([-np.inf, np.inf])
            side = np.sort(side * model.actuator_gear[k, 0])
        turn = 2 * np.pi * abs(model.actuator_gear[k, 0])
        turns = joint is not None and UNITS.get(int(model.jnt_type[joint])) == "rad" and is_servo(model, k)
        if turns and np.ptp(side) > turn:
            low = np.clip(start[k] - turn / 2, side[0], side[1] - turn)
            side = np.array([low, low + turn])
            endless.append(names[k])
        sides.append(side)
    if endless:
        remarks.append(f"more than a turn would be free, so half a turn each way from the start: {', '.join(endless)}")
    if not chosen:
        raise ValueError("; ".join(["no actuator moves a joint of the model with a range", *remarks]))
    low, high = np.array(sides).T
    return Box(low, high, tuple(names[k] for k in chosen)), chosen, remarks


def slides_on(model: mujoco.MjModel, joint: int | None) -> bool:
    """Whether a joint slides without a range."""
    return joint is not None and not model.jnt_limited[joint] and UNITS.get(int(model.jnt_type[joint])) == "m"


def joint_of(model: mujoco.MjModel, actuator: int) -> int | None:
    """The joint that an actuator acts on; None if it acts on something else."""
    return int(model.actuator_trnid[actuator, 0]) if int(model.actuator_trntype[actuator]) in _ON_JOINT else None


def holding(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """``(nu,)`` commands that hold the present posture: positions of servos; other commands stay as they are."""
    held = data.ctrl.copy()
    for k in range(model.nu):
        if is_servo(model, k):
            bias, slope = model.actuator_biasprm[k, :2]
            held[k] = -(bias + slope * data.actuator_length[k]) / model.actuator_gainprm[k, 0]
    return np.where(model.actuator_ctrllimited, np.clip(held, *model.actuator_ctrlrange.T), held)


def positions(model: mujoco.MjModel, actuators: Sequence[int]) -> tuple[str, ...]:
    """Names of the joints whose positions the commands of ``actuators`` are; () if a command is anything else."""
    unscaled = (model.actuator_gear[:, 0] == 1) & (model.actuator_biasprm[:, 0] == 0)
    unscaled &= np.isclose(model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 1])
    joints = [joint_of(model, k) if is_servo(model, k) and unscaled[k] else None for k in actuators]
    return () if None in joints else tuple(model.joint(k).name for k in joints)


def moved_by(model: mujoco.MjModel, actuators: Sequence[int]) -> list[int]:
    """Bodies that a joint of one of ``actuators`` moves, from the base outwards; all if they act on no joint."""
    joints, bodies = {joint_of(model, k) for k in actuators}, [*range(1, model.nbody)]
    return [body for body in bodies if joints & {*joints_above(model, body)}] or bodies


def pulled(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Each constraint by which a mocap body pulls another body, and that other body."""
    found = []
    for k in range(model.neq):
        ends = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_BODY and min(ends) >= 0:
            mocap = [bool(model.body_mocapid[body] >= 0) for body in ends]
            if mocap[0] != mocap[1]:
                found.append((k, ends[mocap[0]]))
    return found


def joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Joints between the world and a body."""
    bodies = path_to(model, body)
    return [k for k in range(model.njnt) if model.jnt_bodyid[k] in bodies]


def movable(model: mujoco.MjModel) -> list[int]:
    """Joints that turn or slide."""
    return [k for k in range(model.njnt) if int(model.jnt_type[k]) in UNITS]


def held_by_servos(model: mujoco.MjModel) -> set[int]:
    """Joints that position servos move or hold."""
    return {joint for k in range(model.nu) if is_servo(model, k) and (joint := joint_of(model, k)) is not None}


def coupled(model: mujoco.MjModel, joints: set[int]) -> bool:
    """Whether an equality couples one of ``joints`` to another joint, or to a body that the joint does not carry."""
    for k in np.flatnonzero(model.eq_active0):
        kind, ends = int(model.eq_type[k]), [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            tied = {*ends}
        elif kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            at_sites = model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
            one, other = (joints_above(model, int(model.site_bodyid[end]) if at_sites else end) for end in ends)
            tied = {*one} ^ {*other}
        else:
            continue
        if tied & joints:
            return True
    return False


def check_moved(model: mujoco.MjModel, place: Place, actuators: Sequence[int]) -> None:
    """Refuse a place that no movement of ``actuators`` can change.

    Raises:
        ValueError: no joint moves the place, or a mocap body holds the arm that carries it.
    """
    what, joints = f"outcome {place.kind}:{place.name} stands still", joints_above(model, body_of(model, place))
    if not joints:
        arm = hand_of(model, place, moved_by(model, actuators))
        raise ValueError(f"{what}: no joint moves it, is it on the base? A place of the arm is {arm.kind}:{arm.name}")
    held = [body for _, body in pulled(model) if {*joints} & {*joints_above(model, body)}]
    if held and not {*joints} & {joint_of(model, k) for k in actuators}:
        name = model.body(held[0]).name
        raise ValueError(f"{what}: a mocap body holds {name}; --environment.servos made moves its joints instead")


def hand_of(model: mujoco.MjModel, place: Place, bodies: Sequence[int]) -> Place:
    """The end of an arm of ``bodies``: ``place`` if the arm carries it, else the outermost site, else the last body."""
    if place.kind != "joint" and body_of(model, place) in bodies:
        return place
    outwards = [body for body in path_to(model, max(bodies, key=lambda k: len(path_to(model, k)))) if body in bodies]
    sites = [k for body in reversed(outwards) for k in range(model.nsite) if model.site_bodyid[k] == body]
    kind, number = ("site", sites[0]) if sites else ("body", outwards[-1])
    return Place(kind, getattr(model, kind)(number).name, number)


def body_of(model: mujoco.MjModel, place: Place) -> int:
    """The body that has a place."""
    bodies = {"site": model.site_bodyid, "geom": model.geom_bodyid, "joint": model.jnt_bodyid}.get(place.kind)
    return place.number if bodies is None else int(bodies[place.number])


def path_to(model: mujoco.MjModel, body: int) -> list[int]:
    """Bodies from the base to ``body``."""
    return [*path_to(model, int(model.body_parentid[body])), body] if body else []


def _names(model: mujoco.MjModel, kind: str) -> list[str]:
    if kind not in _COUNTS:
        return []
    names = [getattr(model, kind)(k).name for k in range(getattr(model, _COUNTS[kind]))]
    return [name for name in names if name]


def find(model: mujoco.MjModel, what: str, kind: str, name: str) -> Place:
    """The place without axes; the message of an error begins with ``what`` and has near names."""
    if kind not in _COUNTS:
        raise ValueError(f"{what}: write KIND:NAME, such as site:tip; kinds are {', '.join(_COUNTS)}")
    names = _names(model, kind)
    if name not in names:
        others = [f"; write {other}:{name}" for other in _COUNTS if name in _names(model, other)]
        near = did_you_mean(name, names, 3) or f"; each {kind} with a name: {', '.join(names[:20]) or 'none'}"
        raise ValueError(f"{what}: the model has no {kind} {name!r}{others[0] if others else near}")
    number = int(getattr(model, kind)(name).id)
    if kind != "joint":
        return Place(kind, name, number)
    if model.jnt_type[number] not in UNITS:
        raise ValueError(f"{what}: only a hinge or a slide joint has one position; write body:NAME")
    return Place(kind, name, number, (), UNITS[int(model.jnt_type[number])], int(model.jnt_qposadr[number]))


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether a command of this actuator is a position to go to."""
    affine = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
    affine &= model.actuator_dyntype[actuator] != mujoco.mjtDyn.mjDYN_INTEGRATOR  # else a command is a speed
    return bool(affine and model.actuator_biasprm[actuator, 1] < 0 < model.actuator_gainprm[actuator, 0])
