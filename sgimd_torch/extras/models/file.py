"""Model files, MJCF or URDF, made ready for movements: position servos, a start posture, contacts that are left out.

robot = load_model(Path("arm.xml"), (), "auto", "", ()); robot.model, robot.start, robot.remarks
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

import mujoco
import numpy as np

from sgimd_torch.extras.models.look import listed
from sgimd_torch.extras.models.places import joint_of, movable, pulled
from sgimd_torch.extras.models.posture import nearest_posture, touching, within_ranges
from sgimd_torch.extras.models.servos import joints_to_serve, serve
from sgimd_torch.files import check_regular
from sgimd_torch.spaces import check_point
from sgimd_torch.texts import unknown_name_error

SERVOS: Final = ("auto", "file", "made")
_FOLDERS: Final = ("assetdir", "meshdir", "texturedir")  # attributes of a compiler
_DEFINITIONS: Final = ("xacro:property", "xacro:arg")
_COPIED: Final = ("replicate", "composite", "flexcomp")  # elements that MuJoCo makes ``count`` times
MOST_PARTS: Final = 100_000  # largest number of elements of a model, copies included
HEIGHTS: Final = 1000  # number of heights of a field that count as one element
_HOMES: Final = ("home", "rest")  # names of keyframes in which movements begin unless another one is chosen


class Loaded(NamedTuple):
    """A model that is ready for movements; limits of joints are known by name, as far as there are any."""

    model: mujoco.MjModel
    start: mujoco.MjData  # state in which movements begin
    posture: tuple[float, ...]  # positions of the joints that turn or slide, at the start
    speeds: dict[str, float]  # rad/s or m/s
    accelerations: dict[str, float]  # rad/s^2 or m/s^2
    remarks: list[str]
    files: list[Path]  # of the model, and all that it includes or refers to, such as meshes


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


def load_model(path: Path, joints: Sequence[str], servos: str, keyframe: str, posture: Sequence[float]) -> Loaded:
    """The model in a file; see `MujocoRobot` for the options.

    Raises:
        ValueError: MuJoCo refuses the file, there is nothing that moves, or an option does not fit.
        OSError: there is no such file.
    """
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        loaded = _load(path, joints, servos, keyframe, posture)
    return loaded._replace(remarks=[*loaded.remarks, *dict.fromkeys(f"warning: {each.message}" for each in heard)])


def _load(path: Path, joints: Sequence[str], servos: str, keyframe: str, posture: Sequence[float]) -> Loaded:
    check_regular(path)  # MuJoCo's own message of a missing file is no OSError
    if servos not in SERVOS:
        raise unknown_name_error("servos", servos, SERVOS)
    if path.suffix.lower() == ".sdf":
        raise ValueError(f"{path.name} is an SDF file; MuJoCo reads MJCF and URDF, so give the robot's URDF")
    included = list[Path]()
    with suppress(expat.ExpatError):  # MuJoCo says where
        included = _check_parts(path)
    remarks, slow, accelerations = list[str](), dict[str, float](), dict[str, float]()
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        for mesh in spec.meshes:
            mesh.file = _of_package(path, mesh.file)
        for kind in (spec.bodies, spec.sites, spec.joints):  # a hand leads an arm by a name
            for k, element in enumerate(kind):
                element.name = element.name or f"unnamed_{k}"
        spec.compiler.fusestatic = False  # else links on fixed joints of a URDF, such as its tool, lose their names
        model, root = spec.compile(), _root(path)
        files = {path, *map(Path, mujoco.mju_getXMLDependencies(str(path)))}
        files |= {path.parent / spec.meshdir / mesh.file for mesh in spec.meshes if mesh.file}
        alone, limits = root.tag == "robot", [(joint, joint.find("limit")) for joint in root.iter("joint")]
        # MuJoCo does not read the speeds of a URDF.
        speeds = {
            joint.get("name", ""): max(0.0, float(limit.get("velocity", 0))) or np.inf
            for joint, limit in limits
            if limit is not None
        }
        if served := joints_to_serve(model, servos, joints, alone=alone):
            cause, held = "motors that are no servos" if model.nu else "no actuators", len(pulled(model))
            model, slow, accelerations = serve(spec, model, served)
            names = ", ".join(model.joint(k).name for k in served)
            remarks.append(f"{path.name} has {cause}: position servos were made for {names}")
            if held > len(pulled(model)):
                remarks.append("constraints to mocap bodies, which would hold the arm, were left out")
        acted = {joint_of(model, k) for k in range(model.nu)}
        arm = [joint for joint in movable(model) if joint in acted]
        bodies = _robot(model, arm, alone=alone)
        model = _without(spec, model, _beside_base(model, bodies))
        keys = [model.key(k).name for k in range(model.nkey)]
        if keyframe and keyframe not in keys:
            raise unknown_name_error(f"keyframe of {path.name}", keyframe, keys)
        keyframe = keyframe or next((key for home in _HOMES for key in keys if key.lower() == home), "")
        data = _reset(model, keyframe)
        if posture:
            data.qpos[model.jnt_qposadr[movable(model)]] = check_point("posture", posture, len(movable(model)))
        else:
            remarks += _take_posture(model, data, arm, bodies, keyframe)
        mujoco.mj_forward(model, data)
        if resting := {pair for pair in touching(model, data, bodies) if pair[0]}:
            links = listed([" and ".join(model.body(body).name for body in pair) for pair in sorted(resting)])
            remarks += [f"contacts in the start posture are left out: {links}"] if not posture else []
            start, model = np.array(data.qpos), _without(spec, model, resting)
            data = _reset(model, keyframe)
            data.qpos[:] = start
        kept = tuple(float(x) for x in data.qpos[model.jnt_qposadr[movable(model)]])
        speeds |= {name: min(speed, speeds.get(name, np.inf)) for name, speed in slow.items()}
        parts = sorted({file.resolve() for file in files if file.is_file()})
        return Loaded(model, data, kept, speeds, accelerations, remarks, parts)
    except (ValueError, expat.ExpatError) as error:
        said = _with_advice(" ".join(str(error).split()), path, included)
        raise ValueError(f"{path.name} cannot be used: {said}") from error


def _check_parts(path: Path) -> list[Path]:
    """The files that a model includes. Refuse what MuJoCo would wait for, a pipe or a device that the model refers to,
    a model that is too large for it, and a template of ROS."""
    roots, known = [_root(path)], [path]
    elements = [*roots[0].iter()]
    for element in elements:  # grows
        defines = element.tag in _DEFINITIONS  # do no harm unless something refers to them
        refers = any("${" in text or "$(" in text for text in element.attrib.values())
        if refers or (element.tag.startswith("xacro:") and not defines):
            raise ValueError(f"{path.name} is a template of xacro; give its result: xacro {path.name} > robot.urdf")
        included = path.parent / element.get("file", "")
        if element.tag == "include" and included not in known and included.exists() and not included.is_dir():
            check_regular(included)
            known.append(included)
            roots.append(_root(included))
            elements += roots[-1].iter()
    if sum(map(_n_parts, roots)) > MOST_PARTS:
        raise _too_large(path)
    compilers = [element.attrib for element in elements if element.tag == "compiler"]
    folders = {path.parent / compiler.get(kind, "") for compiler in compilers for kind in _FOLDERS} | {path.parent}
    for element in elements:
        for file in (text for name, text in element.attrib.items() if name.startswith("file")):
            for mesh in (folder / name for folder in folders for name in (file, Path(file).name)):
                if mesh.exists():
                    check_regular(mesh)
    return known[1:]


def _n_parts(root: ElementTree.Element) -> float:
    """Number of elements, copies included; the heights of a field count, too."""
    n, waiting = 0.0, [(root, 1)]
    while waiting:
        element, copies = waiting.pop()
        numbers = {name: [int(word) for word in text.split() if word.isdigit()] for name, text in element.items()}
        copies *= math.prod(numbers.get("count", ())) if element.tag in _COPIED else 1
        n += copies + math.prod([*numbers.get("nrow", [0]), *numbers.get("ncol", [0])]) / HEIGHTS
        waiting += [(child, copies) for child in element]
    return n


def _too_large(path: Path) -> ValueError:
    most = f"{MOST_PARTS} elements, or {MOST_PARTS * HEIGHTS:.0e} heights of a field"
    return ValueError(f"{path.name} has more than {most}: too large to move a robot in it; was a count mistyped?")


def _root(path: Path) -> ElementTree.Element:
    """The first tag of a file. As for MuJoCo, blanks around it do no harm, nor does a prefix without a namespace."""
    content, builder, parser = path.read_bytes().strip(b"\0 \t\r\n"), ElementTree.TreeBuilder(), expat.ParserCreate()
    if content.count(b"<") > 4 * MOST_PARTS:
        raise _too_large(path)
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.Parse(content, True)
    return builder.close()


def _reset(model: mujoco.MjModel, keyframe: str) -> mujoco.MjData:
    """The state of a keyframe, "" for the initial state."""
    data = mujoco.MjData(model)
    if keyframe:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    return data


def _take_posture(
    model: mujoco.MjModel, data: mujoco.MjData, arm: Sequence[int], bodies: Sequence[int], keyframe: str
) -> list[str]:
    """Put the nearest posture within all ranges and without contacts of ``bodies`` into ``data``; a keyframe stays."""
    before, data.qpos[:] = np.array(data.qpos), within_ranges(model, data.qpos)
    outside = [model.joint(k).name for k in movable(model) if data.qpos[a := model.jnt_qposadr[k]] != before[a]]
    if keyframe:
        data.qpos[:] = before
        return [f"keyframe {keyframe} puts {', '.join(outside)} outside the range"] * bool(outside)
    mujoco.mj_forward(model, data)
    within, kept = np.array(data.qpos), set[tuple[int, int]]()
    if touched := bool(touching(model, data, bodies)):
        for _ in range(2):  # pairs that nothing parts would drag the posture far away
            data.qpos[:] = nearest_posture(model, within, arm, bodies, kept)
            mujoco.mj_forward(model, data)
            if not (kept := touching(model, data, bodies)):
                break
    way = float(np.abs(data.qpos - before).max(initial=0))
    causes = [f"{', '.join(outside)} outside the range"] * bool(outside) + ["links that touch"] * touched
    said = (
        f"it begins with {' and '.join(causes)}: movements begin in the nearest right posture, {way:.2g} rad or m off; "
        "for another, write a <key> named home into the model, or give --environment.keyframe"
    )
    return [said] * (way > 1e-6)


def _robot(model: mujoco.MjModel, arm: Sequence[int], *, alone: bool) -> list[int]:
    """Bodies of the trees that ``arm`` moves, their bases too."""
    roots = {int(model.body_rootid[model.jnt_bodyid[k]]) for k in arm}
    return [k for k in range(model.nbody) if (int(model.body_rootid[k]) in roots if k else alone)]


def _beside_base(model: mujoco.MjModel, bodies: Sequence[int]) -> set[tuple[int, int]]:
    """Pairs of a base and the link on it; MuJoCo leaves out contacts of a body with its parent, but not with a base."""
    fixed = [k for k in bodies if not model.body_weldid[k]]
    links = [k for k in bodies if model.body_weldid[k] and not model.body_weldid[model.body_parentid[k]]]
    return {(base, link) for base in fixed for link in links if model.body_rootid[base] in (0, model.body_rootid[link])}


def _without(spec: mujoco.MjSpec, model: mujoco.MjModel, pairs: set[tuple[int, int]]) -> mujoco.MjModel:
    """The model without contacts between these pairs of bodies."""
    known = {frozenset((exclude.bodyname1, exclude.bodyname2)) for exclude in spec.excludes}
    named = [tuple(model.body(body).name for body in pair) for pair in sorted(pairs)]
    new = [pair for pair in named if frozenset(pair) not in known]
    for one, other in new:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    return spec.compile() if new else model


def _of_package(path: Path, file: str) -> str:
    """The path of package://NAME/FILE, a mesh of ROS, in the folder NAME or beside it; other files unchanged."""
    head, _, rest = file.removeprefix("package://").partition("/")
    if not file.startswith("package://"):
        return file
    found = [folder / name for folder in path.resolve().parents for name in (f"{head}/{rest}", rest)]
    mesh = next((path for path in found if path.is_file()), None)
    if mesh is None:
        raise ValueError(f"no folder from {path.resolve().parent} up has the mesh {file}; put the folder {head} there")
    return str(mesh)


def _with_advice(said: str, path: Path, included: Sequence[Path]) -> str:
    """A message of MuJoCo, with what to do, and where it is: in included files MuJoCo counts no lines."""
    advice = {
        "balanceinertia": _write('balanceinertia="true"', path),
        "mjMINVAL": _write('boundmass="1e-4" boundinertia="1e-6"', path),
        "decoder": "; MuJoCo reads MJCF or URDF, and meshes as .stl, .obj or .msh: convert it, or leave it out",
        "positive eigenvalues": "; correct its ixx, iyy and izz",
        "must be positive in geom": '; leave out what has no size, such as <sphere radius="0"/>',
        "parent or child missing": '; each parent and child needs a link, also the world: <link name="world"/>',
        "opening file": "; put it beside the model, or into its meshdir, or leave it out",
    }
    named = [word.encode() for word in re.findall("'(.+?)'", said)]
    where = [file.name for file in included if all(word in file.read_bytes() for word in named)]
    found = f"; see the included file {' or '.join(where)}" * bool(where and said.endswith("line 0"))
    return said + found + "".join(text for word, text in advice.items() if word in said)


def _write(attributes: str, path: Path) -> str:
    line = f"<compiler {attributes}/>"
    line = f"<mujoco>{line}</mujoco>" if path.suffix.lower() == ".urdf" else line
    return f"; write {line} into {path.name}, after its first tag"
