"""Models of MuJoCo: MJCF and URDF files, the names in them, and the places that an outcome or a context is made of.

model = load_model(Path("arm.xml"), ()); places = outcome_places(model, "site:tip:xy"); places[0].read(data)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np

from sgimd_torch.catalogue import did_you_mean
from sgimd_torch.spaces import Array, Box, stream

KINDS: Final = {"site": "nsite", "body": "nbody", "geom": "ngeom", "joint": "njnt"}  # kinds of places, and their counts
_AXES: Final = "xyz"
_HINGE, _SLIDE, _FREE = (int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("HINGE", "SLIDE", "FREE"))
_STIFFNESS: Final = 30.0  # natural frequency (rad/s) of a position servo that is made for a joint
_SAG: Final = 0.05  # largest error (rad or m) of such a servo that holds a joint against gravity


@dataclass(frozen=True)
class Place:
    """Coordinates of a site, a body or a geom (m), or the position of a joint (rad or m).

    Args:
        kind: "site", "body", "geom" or "joint".
        name: name in the model.
        number: index in the model.
        axes: indices of the coordinates; () for a joint.
        unit: "m" or "rad".
        address: index of the position of a joint in ``qpos``; -1 for other kinds.
    """

    kind: str
    name: str
    number: int
    axes: tuple[int, ...]
    unit: str
    address: int = -1

    def read(self, data: mujoco.MjData) -> Array:
        """The coordinates now."""
        if self.kind == "joint":
            return data.qpos[self.address : self.address + 1].copy()
        places = {"site": data.site_xpos, "body": data.xpos, "geom": data.geom_xpos}[self.kind]
        return places[self.number, list(self.axes)]

    @property
    def names(self) -> list[str]:
        """Name of each coordinate."""
        return [f"{self.name} {_AXES[axis]}" for axis in self.axes] or [self.name]


def load_model(path: Path, joints: Sequence[str]) -> tuple[mujoco.MjModel, list[str]]:
    """The model in a file, and remarks; ``joints`` of a model without actuators get position servos.

    Raises:
        ValueError: MuJoCo refuses the file, or there is nothing that moves.
        OSError: there is no such file.
    """
    with open(path, "rb"):  # MuJoCo's own message of a missing file is no OSError
        pass
    remarks = list[str]()
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.fusestatic = False  # else links on fixed joints of a URDF, such as its tool, lose their names
        model = spec.compile()
        if not model.nu:
            served = _serve(spec, model, joints or [name for name in names_of(model, "joint") if name])
            remarks.append(f"{path.name} has no actuators: position servos were made for {', '.join(served)}")
            model = spec.compile()
    except ValueError as error:
        raise ValueError(f"{path.name} cannot be used: {' '.join(str(error).split())}") from error
    return model, remarks


def files_of(path: Path) -> list[Path]:
    """The file of a model, and all files that it includes or refers to, such as meshes."""
    spec, found = mujoco.MjSpec.from_file(str(path)), {path}
    found |= {Path(each) for each in mujoco.mju_getXMLDependencies(str(path))}
    found |= {path.parent / spec.meshdir / each.file for each in spec.meshes if each.file}  # of a URDF
    return sorted(each for each in found if each.is_file())


def names_of(model: mujoco.MjModel, kind: str) -> list[str]:
    """Names of all sites, bodies, geoms or joints; "" for one without a name."""
    one: Callable[[int], Any] = getattr(model, kind)
    return [one(k).name for k in range(getattr(model, KINDS[kind]))]


def find(model: mujoco.MjModel, kind: str, name: str, what: str) -> int:
    """Index of a named thing of the model.

    Raises:
        ValueError: there is none; the message has near names, or the kind that has this name.
    """
    if kind not in KINDS:
        raise ValueError(f"{what}: write KIND:NAME, such as site:tip; kinds are {', '.join(KINDS)}, got {kind!r}")
    names = names_of(model, kind)
    if name in names and name:
        return names.index(name)
    known = [each for each in names if each]
    others = [each for each in KINDS if each != kind and name and name in names_of(model, each)]
    near = did_you_mean(name, known, 3) or f"; {kind}s with a name are: {', '.join(known[:20]) or 'none'}"
    hint = f"; write {others[0]}:{name}" if others else near
    raise ValueError(f"{what}: the model has no {kind} {name!r}{hint}")


def outcome_places(model: mujoco.MjModel, outcome: str) -> list[Place]:
    """The places that ``outcome`` lists, such as "site:tip:xy,body:cup".

    Raises:
        ValueError: the text names nothing of the model, or lengths and angles.
    """
    if not outcome:
        each = [f"{kind}:{name}" for kind in KINDS for name in names_of(model, kind) if name not in ("", "world")]
        raise ValueError(f"outcome is missing: it names what goals are about, one of {', '.join(each[:20])}")
    places = []
    for text in outcome.split(","):
        kind, _, rest = text.strip().partition(":")
        name, _, axes = rest.partition(":")
        number, what = find(model, kind, name, f"outcome {text!r}"), f"outcome {text!r}"
        if kind == "joint":
            places.append(_joint(model, number, what, axes))
        elif not set(axes) <= set(_AXES) or len(set(axes)) < len(axes):
            raise ValueError(f"{what}: {axes!r} are no axes; write x, y, z or several of them, such as {text[:-1]}xy")
        else:
            places.append(Place(kind, name, number, tuple(map(_AXES.index, axes or _AXES)), "m"))
    if len({each.unit for each in places}) > 1:
        raise ValueError(f"outcome {outcome!r} mixes lengths (m) and angles (rad); a goal needs one unit")
    return places


def context_box(model: mujoco.MjModel, context: str) -> tuple[Box, list[int]]:
    """C, and the index in ``qpos`` of each of its dimensions.

    Args:
        model: model of the robot and its objects.
        context: list such as "body:cup:x:0.1:0.3,joint:door:0:1": for each dimension an axis of a free body, or a
            joint, and its lowest and highest initial position; "" for none.

    Raises:
        ValueError: the text names nothing of the model, a body is not free, or a number is wrong.
    """
    sides, names, units, addresses = list[tuple[float, float]](), list[str](), list[str](), list[int]()
    for text in filter(None, context.split(",")):
        kind, *words = text.strip().split(":")
        what, wanted = f"context {text!r}", 4 if kind == "body" else 3
        if kind not in ("body", "joint") or len(words) != wanted:
            raise ValueError(f"{what}: write body:NAME:AXIS:LOW:HIGH for a free body, or joint:NAME:LOW:HIGH")
        try:
            low, high = map(float, words[-2:])
        except ValueError:
            raise ValueError(f"{what}: {words[-2]} and {words[-1]} must be numbers, in m or rad") from None
        number = find(model, kind, words[0], what)
        if kind == "joint":
            place = _joint(model, number, what)
            address, name, unit = place.address, place.name, place.unit
        else:
            body = model.body(number)
            joints = [model.joint(k) for k in range(body.jntadr[0], body.jntadr[0] + body.jntnum[0])]
            if [each.type[0] for each in joints] != [_FREE] or words[1] not in tuple(_AXES):
                own = f"; write joint:NAME with one of {', '.join(each.name for each in joints)}" if joints else ""
                raise ValueError(f"{what}: only a body with a free joint has an AXIS to set, x, y or z{own}")
            address, name, unit = joints[0].qposadr[0] + _AXES.index(words[1]), f"{words[0]} {words[1]}", "m"
        sides.append((low, high))
        names.append(name)
        units.append(unit)
        addresses.append(int(address))
    try:
        return _box(sides, names, units), addresses
    except ValueError as error:
        raise ValueError(f"context {context!r}: {error}") from error


def commands_box(model: mujoco.MjModel, joints: Sequence[str]) -> tuple[Box, list[int], list[str]]:
    """Ranges of the commands of a movement, the actuator of each command, and remarks.

    Args:
        model: model of the robot.
        joints: names of joints or of actuators; () for all actuators.

    Raises:
        ValueError: a joint does not exist or has no actuator, or a command has no range.
    """
    actuators = [model.actuator(k) for k in range(model.nu)]
    moved: dict[str, list[int]] = {each.name: [each.id] for each in actuators if each.name}
    for each in actuators:
        if each.trntype[0] in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
            moved[model.joint(each.trnid[0]).name] = [
                k.id for k in actuators if k.trntype[0] == each.trntype[0] and k.trnid[0] == each.trnid[0]
            ]
    for name in joints:
        if name not in moved:
            number = find(model, "joint", name, "joints")
            raise ValueError(f"joints: {names_of(model, 'joint')[number]} has no actuator; {', '.join(moved)} have one")
    chosen = list(dict.fromkeys(k for name in joints for k in moved[name])) or list(range(model.nu))
    sides, names, units, remarks = list[tuple[float, float]](), list[str](), list[str](), list[str]()
    for k in chosen:
        actuator, low, high, unit = actuators[k], *model.actuator_ctrlrange[k], ""
        joint = model.joint(actuator.trnid[0]) if is_servo(model, k) and "JOINT" in _transmission(actuator) else None
        if joint is not None:
            unit = "rad" if joint.type[0] == _HINGE else "m"
        if not model.actuator_ctrllimited[k]:
            if joint is None or (unit == "m" and not model.jnt_limited[joint.id]):
                raise ValueError(f"actuator {actuator.name!r} has no ctrlrange; write one into the model")
            low, high = np.array(joint.range if model.jnt_limited[joint.id] else (-np.pi, np.pi)) * actuator.gear[0]
            if not model.jnt_limited[joint.id]:
                remarks.append(f"joint {joint.name} has no range: it turns from -pi to pi")
        sides.append((float(min(low, high)), float(max(low, high))))
        names.append(actuator.name or (joint.name if joint is not None else f"actuator {k}"))
        units.append(unit)
    return _box(sides, names, units), chosen, remarks


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether a command of this actuator is a position to go to."""
    affine = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(affine and model.actuator_biasprm[actuator, 1] < 0 < model.actuator_gainprm[actuator, 0])


def holding(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """``(nu,)`` commands that hold the present posture: positions of servos; other commands stay as they are."""
    held = data.ctrl.copy()
    for k in filter(lambda k: is_servo(model, k), range(model.nu)):
        bias, slope = model.actuator_biasprm[k, :2]
        held[k] = -(bias + slope * data.actuator_length[k]) / model.actuator_gainprm[k, 0]
        if model.actuator_ctrllimited[k]:
            held[k] = np.clip(held[k], *model.actuator_ctrlrange[k])
    return held


def chain_to(model: mujoco.MjModel, place: Place, actuators: Sequence[int]) -> list[int]:
    """Bodies from the base of the robot to ``place`` if the robot carries it, else to the last body that it moves."""
    joints = [int(model.actuator_trnid[k, 0]) for k in actuators if "JOINT" in _transmission(model.actuator(k))]
    driven = {int(model.jnt_bodyid[k]) for k in joints}
    of_place = {"site": model.site_bodyid, "geom": model.geom_bodyid, "joint": model.jnt_bodyid}.get(place.kind)
    body = place.number if of_place is None else int(of_place[place.number])

    def path(body: int) -> list[int]:
        return [*path(int(model.body_parentid[body])), body] if body else []

    if driven & {*path(body)} or not driven:
        return path(body)
    return max(map(path, driven), key=len)


def _transmission(actuator: Any) -> str:
    return mujoco.mjtTrn(actuator.trntype[0]).name


def _joint(model: mujoco.MjModel, number: int, what: str, axes: str = "") -> Place:
    joint = model.joint(number)
    if joint.type[0] not in (_HINGE, _SLIDE) or axes:
        raise ValueError(f"{what}: only a hinge or a slide joint is a place, and it has no axes")
    unit = "rad" if joint.type[0] == _HINGE else "m"
    return Place("joint", joint.name, number, (), unit, int(joint.qposadr[0]))


def _box(sides: Sequence[tuple[float, float]], names: Sequence[str], units: Sequence[str]) -> Box:
    """A box; if units differ, each name has its own."""
    low, high = np.array(sides).reshape(-1, 2).T
    if len({*units}) > 1:
        return Box(
            low, high, tuple(f"{name} ({unit})" if unit else name for name, unit in zip(names, units, strict=True))
        )
    return Box(low, high, tuple(names), "".join({*units}))


def _serve(spec: mujoco.MjSpec, model: mujoco.MjModel, joints: Sequence[str]) -> list[str]:
    """Add a position servo to each hinge or slide of ``joints``; the result is their names.

    The stiffness moves the greatest inertia of a joint with 30 rad/s, and holds it against gravity.
    """
    numbers = [find(model, "joint", name, "joints") for name in joints]
    chosen = [k for k in numbers if model.jnt_type[k] in (_HINGE, _SLIDE)]
    if not chosen:
        raise ValueError("it has no joint that turns or slides")
    data, inertias, loads = mujoco.MjData(model), np.zeros(model.nv), np.zeros(model.nv)
    for k in range(50):
        data.qpos[:] = model.qpos0
        for joint, share in zip(chosen, stream(0, "postures", k).random(len(chosen)), strict=True):
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.pi, np.pi)
            data.qpos[model.jnt_qposadr[joint]] = low + share * (high - low)
        mujoco.mj_forward(model, data)
        loads = np.maximum(loads, np.abs(data.qfrc_bias))
        for dof, unit in enumerate(np.eye(model.nv)):
            product = np.empty(model.nv)
            mujoco.mj_mulM(model, data, product, unit)
            inertias[dof] = max(inertias[dof], product[dof])
    for joint in chosen:
        dof = model.jnt_dofadr[joint]
        stiffness = max(inertias[dof] * _STIFFNESS**2, loads[dof] / _SAG)
        servo = spec.add_actuator(name=model.joint(joint).name, target=model.joint(joint).name)
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
        servo.set_to_position(kp=stiffness, kv=2 * np.sqrt(stiffness * inertias[dof]))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # stable with the damping of light joints
    return [model.joint(k).name for k in chosen]
