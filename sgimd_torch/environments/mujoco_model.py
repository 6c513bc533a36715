"""Models of MuJoCo: MJCF and URDF files, and what a text such as "site:tip:xy" names in them.

model, remarks = load_model(Path("arm.xml"), ()); place, = outcome_places(model, "site:tip:xy"); place.read(data)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.files import check_regular
from sgimd_torch.options.catalogue import did_you_mean
from sgimd_torch.spaces import Array, Box, stream

_COUNTS: Final = {"site": "nsite", "body": "nbody", "geom": "ngeom", "joint": "njnt"}
_AXES: Final = "xyz"
_UNITS: Final = {int(mujoco.mjtJoint.mjJNT_HINGE): "rad", int(mujoco.mjtJoint.mjJNT_SLIDE): "m"}  # of joints
_FREE: Final = int(mujoco.mjtJoint.mjJNT_FREE)
_ON_JOINT: Final = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_FREQUENCY: Final = 30.0  # natural frequency (rad/s) of a position servo that is made for a joint
_SAG: Final = 0.05  # largest error (rad or m) of such a servo when it holds a joint against gravity


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


def file_of(model: str | Path) -> Path:
    """The file of a model: its path, or the scene of a robot of the package mujoco-menagerie, such as menagerie:aloha.

    Raises:
        ValueError: the package is not installed, it has no such robot, or it cannot download the robot.
    """
    collection, _, name = str(model).partition(":")
    if collection != "menagerie":
        return Path(model)
    try:
        import mujoco_menagerie  # an optional dependency
    except ImportError as error:
        raise ValueError(f"{model} needs a package that is not installed: pip install mujoco-menagerie") from error
    try:
        return Path(mujoco_menagerie.get(name).xml())
    except mujoco_menagerie.MenagerieError as error:
        raise ValueError(f"model {model}: {error}") from error


def load_model(path: Path, joints: Sequence[str]) -> tuple[mujoco.MjModel, list[str]]:
    """The model in a file, and remarks; ``joints`` of a model without actuators get position servos.

    Raises:
        ValueError: MuJoCo refuses the file, or there is nothing that moves.
        OSError: there is no such file.
    """
    check_regular(path)  # MuJoCo's own message of a missing file is no OSError
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        for mesh in spec.meshes:
            mesh.file = _of_package(path, mesh.file)
        for kind in (spec.bodies, spec.sites):  # a hand leads an arm by a name
            for k, element in enumerate(kind):
                element.name = element.name or f"unnamed_{k}"
        spec.compiler.fusestatic = False  # else links on fixed joints of a URDF, such as its tool, lose their names
        model = spec.compile()
        if model.nu:
            return model, []
        served = _serve(spec, model, joints)
        remark = f"{path.name} has no actuators: position servos were made for {', '.join(served)}"
        return spec.compile(), [remark]
    except ValueError as error:
        raise ValueError(f"{path.name} cannot be used: {' '.join(str(error).split())}") from error


def files_of(path: Path) -> list[Path]:
    """The file of a model, and all files that it includes or refers to, such as meshes."""
    spec, files = mujoco.MjSpec.from_file(str(path)), {path, *map(Path, mujoco.mju_getXMLDependencies(str(path)))}
    files |= {path.parent / spec.meshdir / _of_package(path, mesh.file) for mesh in spec.meshes if mesh.file}
    return sorted({file.resolve() for file in files if file.is_file()})


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
        kind, name, axes = (*text.strip().split(":", 2), "", "")[:3]
        place = _find(model, f"outcome {text!r}", kind, name)
        if not set(axes) <= set(_AXES if kind != "joint" else "") or len(set(axes)) < len(axes):
            raise ValueError(f"outcome {text!r}: {axes!r} are no axes; write some of x, y and z, for a joint nothing")
        axes = axes or _AXES if kind != "joint" else ""
        places.append(Place(kind, name, place.number, tuple(map(_AXES.index, axes)), place.unit, place.address))
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
        kind, *words = text.strip().split(":")
        what = f"context {text!r}"
        if (kind, len(words)) not in (("body", 4), ("joint", 3)):
            raise ValueError(f"{what}: write body:NAME:AXIS:LOW:HIGH for a free body, or joint:NAME:LOW:HIGH")
        place, (low, high) = _find(model, what, kind, words[0]), words[-2:]
        address, name = place.address, " ".join(words[:-2])
        if kind == "body":
            joint = int(model.body_jntadr[place.number])
            if joint < 0 or model.jnt_type[joint] != _FREE or words[1] not in tuple(_AXES):
                raise ValueError(f"{what}: only a body with a free joint has an axis x, y or z; else write joint:NAME")
            address = int(model.jnt_qposadr[joint]) + _AXES.index(words[1])
        try:
            sides.append([float(low), float(high)])
            Box(*np.array(sides[-1:]).T)
        except ValueError:
            raise ValueError(f"{what}: {low} and {high} must be two numbers, the lower one first") from None
        names.append(name if place.unit == "m" else f"{name} ({place.unit})")
        units.append(place.unit)
        addresses.append(address)
    lows, highs = np.array(sides).reshape(-1, 2).T
    return Box(lows, highs, tuple(names), "m" if {*units} == {"m"} else ""), addresses


def commands_box(model: mujoco.MjModel, joints: Sequence[str]) -> tuple[Box, list[int], list[str]]:
    """Ranges of the commands of a movement, the actuator of each command, and remarks.

    Args:
        model: model of the robot.
        joints: names of joints, or of actuators that act on no joint; () for all actuators.

    Raises:
        ValueError: a joint does not exist or has no actuator, or a command has no range.
    """
    moved, sides, remarks = dict[str, list[int]](), list[Array](), list[str]()
    for k in range(model.nu):
        joint = joint_of(model, k)
        moved.setdefault(model.actuator(k).name if joint is None else model.joint(joint).name, []).append(k)
    for name in joints:
        if name not in moved:
            hint = did_you_mean(name, moved) or f"; known are {', '.join(moved)}"
            raise ValueError(f"joints: {name!r} is no joint with an actuator{hint}")
    chosen = [k for name in joints or moved for k in moved[name]]
    for k in chosen:
        joint, side = joint_of(model, k), model.actuator_ctrlrange[k]
        if not model.actuator_ctrllimited[k]:
            if joint is None or not _is_servo(model, k):
                raise ValueError(f"actuator {model.actuator(k).name!r} has no ctrlrange; write one into the model")
            side = model.jnt_range[joint]
            if not model.jnt_limited[joint]:
                side = np.array([-np.pi, np.pi])
                remarks.append(f"joint {model.joint(joint).name} has no range: -pi to pi is used")
            side = np.sort(side * model.actuator_gear[k, 0])
        sides.append(side)
    return Box(*np.array(sides).T), chosen, remarks


def joint_of(model: mujoco.MjModel, actuator: int) -> int | None:
    """The joint that an actuator acts on; None if it acts on something else."""
    return int(model.actuator_trnid[actuator, 0]) if int(model.actuator_trntype[actuator]) in _ON_JOINT else None


def holding(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """``(nu,)`` commands that hold the present posture: positions of servos; other commands stay as they are."""
    held = data.ctrl.copy()
    for k in range(model.nu):
        if _is_servo(model, k):
            bias, slope = model.actuator_biasprm[k, :2]
            held[k] = -(bias + slope * data.actuator_length[k]) / model.actuator_gainprm[k, 0]
    return np.where(model.actuator_ctrllimited, np.clip(held, *model.actuator_ctrlrange.T), held)


def positions(model: mujoco.MjModel, actuators: Sequence[int]) -> tuple[str, ...]:
    """Names of the joints whose positions the commands of ``actuators`` are; () if a command is anything else."""
    joints = [joint_of(model, k) if _is_servo(model, k) and model.actuator_gear[k, 0] == 1 else None for k in actuators]
    return () if None in joints else tuple(model.joint(k).name for k in joints)


def moved_by(model: mujoco.MjModel, actuators: Sequence[int]) -> list[int]:
    """Bodies that a joint of one of ``actuators`` moves, from the base outwards; all if they act on no joint."""
    bodies = {int(model.jnt_bodyid[joint]) for k in actuators if (joint := joint_of(model, k)) is not None}
    for body in range(1, model.nbody):  # a parent has a lower number
        if int(model.body_parentid[body]) in bodies:
            bodies.add(body)
    return sorted(bodies) or [*range(1, model.nbody)]


def hand_of(model: mujoco.MjModel, place: Place, bodies: Sequence[int]) -> Place:
    """The end of an arm of ``bodies``: ``place`` if the arm carries it, else the outermost site, else the last body."""
    if place.kind != "joint" and body_of(model, place) in bodies:
        return place
    outwards = path_to(model, max(bodies, key=lambda body: len(path_to(model, body))))
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


def _of_package(path: Path, file: str) -> str:
    """The place of package://NAME/FILE, a mesh of ROS, in the folder NAME or beside it; other files unchanged."""
    head, _, rest = file.removeprefix("package://").partition("/")
    if not file.startswith("package://"):
        return file
    places = [folder / name for folder in path.resolve().parents for name in (f"{head}/{rest}", rest)]
    return str(next((place for place in places if place.is_file()), rest))


def _names(model: mujoco.MjModel, kind: str) -> list[str]:
    names = [getattr(model, kind)(k).name for k in range(getattr(model, _COUNTS[kind]))]
    return [name for name in names if name]


def _find(model: mujoco.MjModel, what: str, kind: str, name: str) -> Place:
    """The place without axes; the message of an error begins with ``what`` and has near names."""
    if kind not in _COUNTS:
        raise ValueError(f"{what}: write KIND:NAME, such as site:tip; kinds are {', '.join(_COUNTS)}")
    names = _names(model, kind)
    if name not in names:
        others = [f"; write {other}:{name}" for other in _COUNTS if name in _names(model, other)]
        near = did_you_mean(name, names, 3) or f"; {kind}s with a name: {', '.join(names[:20]) or 'none'}"
        raise ValueError(f"{what}: the model has no {kind} {name!r}{others[0] if others else near}")
    number = int(getattr(model, kind)(name).id)
    if kind != "joint":
        return Place(kind, name, number)
    if model.jnt_type[number] not in _UNITS:
        raise ValueError(f"{what}: only a hinge or a slide joint has one position; write body:NAME")
    return Place(kind, name, number, (), _UNITS[int(model.jnt_type[number])], int(model.jnt_qposadr[number]))


def _is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether a command of this actuator is a position to go to."""
    affine = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(affine and model.actuator_biasprm[actuator, 1] < 0 < model.actuator_gainprm[actuator, 0])


def _serve(spec: mujoco.MjSpec, model: mujoco.MjModel, joints: Sequence[str]) -> list[str]:
    """Add a position servo to each hinge and slide of ``joints``, () for all of them; returns their names.

    A servo moves the greatest inertia of its joint with the natural frequency, and holds it against gravity.
    """
    wanted = [_find(model, "joints", "joint", name).number for name in joints] or range(model.njnt)
    chosen = [k for k in wanted if int(model.jnt_type[k]) in _UNITS and model.joint(k).name]
    if not chosen:
        raise ValueError("it has no joint with a name that turns or slides")
    data, inertias, loads = mujoco.MjData(model), np.zeros(model.nv), np.zeros(model.nv)
    for posture in range(50):
        shares = stream(0, "postures", posture).random(model.njnt)
        for k in chosen:
            low, high = model.jnt_range[k] if model.jnt_limited[k] else (-np.pi, np.pi)
            data.qpos[model.jnt_qposadr[k]] = low + shares[k] * (high - low)
        mujoco.mj_forward(model, data)
        loads = np.maximum(loads, np.abs(data.qfrc_bias))
        for dof, unit in enumerate(np.eye(model.nv)):
            product = np.empty(model.nv)
            mujoco.mj_mulM(model, data, product, unit)
            inertias[dof] = max(inertias[dof], product[dof])
    for k in chosen:
        name, inertia, load = model.joint(k).name, *(numbers[model.jnt_dofadr[k]] for numbers in (inertias, loads))
        stiffness = max(inertia * _FREQUENCY**2, load / _SAG)
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=stiffness, kv=2 * np.sqrt(stiffness * inertia))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # stable with the damping of light joints
    return [model.joint(k).name for k in chosen]
