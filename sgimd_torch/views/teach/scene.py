"""The scene: the robot that a hand leads, the learner's movements as an outline, and the map of T on the ground.

    scene = Scene(server, led, outcomes, goals); scene.draw_arm(hanging.data); scene.draw_map(by_error(chart, outcomes))
Places in T are places in the model's plane z = 0: what lands there lands on the map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from sgimd_torch.environments.protocol import HandLed
from sgimd_torch.spaces import Array, Box
from sgimd_torch.views.teach.chart import CELLS, SKILL, Colours

THIN: Final = 0.003  # m: geoms with a smaller radius are drawn as lines
HAND, LEARNER, GOAL, MET, UNMET = (240, 120, 30), (60, 70, 190), (230, 60, 120), (10, 110, 50), (120, 140, 160)
PIXELS: Final = 8  # of the map's picture, for each cell
DOT: Final = 2  # pixels, radius of a goal
_DISC: Final = np.hypot(*np.mgrid[-DOT : DOT + 1, -DOT : DOT + 1]) <= DOT + 0.3
ABOVE: Final = 0.002  # m, from one layer of the map to the next


@dataclass(frozen=True)
class Grip:
    """A part of the robot that can be dragged: the ``body`` that it belongs to, its ``handle`` in the scene, and
    whether it is the hand itself."""

    body: str
    handle: Any
    is_hand: bool = False


class Scene:
    """Everything that is drawn.

    Args:
        server: that shows it, to all viewers alike.
        led: the robot.
        outcomes: T.
        goals: ``(n, outcome_dim)`` of the benchmark.
    """

    def __init__(self, server: viser.ViserServer, led: HandLed, outcomes: Box, goals: Array) -> None:
        self._scene, self._led, self._outcomes = server.scene, led, outcomes
        self._model = model = led.model
        self.size = float(outcomes.sides[:2].max())
        middle = self.ground((outcomes.low + outcomes.high) / 2)
        blank = np.full((CELLS, CELLS, 3), SKILL[0], dtype=np.uint8)
        width, height = self._sides()
        self._places = self._pixels(goals, outcomes)
        self.map = self._scene.add_image(
            "/map", _smooth(blank, 1), width, height, format="png", wxyz=(0, 1, 0, 0), position=middle
        )
        self._landings = self._points("/landings", self.ground(goals[:1], 2), LEARNER, 0.01)
        self._landings.visible = False
        thick = [k for k in range(model.ngeom) if model.geom_bodyid[k] and model.geom_size[k, 0] > THIN]
        thin = [k for k in range(model.ngeom) if model.geom_bodyid[k] and model.geom_size[k, 0] <= THIN]
        self._drawn = np.empty(0)
        self._geoms = {k: self._add_geom(k) for k in thick}
        self._thin = np.array(thin, dtype=np.int64)
        self._line = self._lines("/line", len(thin), (30, 30, 30), 0.005)
        self._hand = self._ball("/hand", HAND, 0.026 * self.size)
        self.chain = np.array([(model.body_parentid[k], k) for k in range(1, model.nbody) if model.body_parentid[k]])
        self._ghost = self._lines("/ghost", len(self.chain), LEARNER, 0.005 * self.size)
        self._ghost_end = self._ball("/ghost_end", LEARNER, 0.014 * self.size)
        self._best = self._lines("/best", len(self.chain), GOAL, 0.006 * self.size)
        self._trace = self._lines("/trace", 1, HAND, 0.006 * self.size)
        self._marks = {
            "goal": self._ring("/mark/goal", GOAL, 0.035),
            "landed": self._ring("/mark/landed", LEARNER, 0.02),
            "expected": self._ring("/mark/expected", (255, 255, 255), 0.02),
            "asked": self._ring("/mark/asked", GOAL, 0.06),
            "lesson": self._ring("/mark/lesson", HAND, 0.03),
        }
        self._labels = {name: self._label(name) for name in self._marks}
        for mark in self._marks.values():
            mark.visible = False
        self._hint = self._scene.add_label("/hint", "drag me", anchor="bottom-center")
        # Browsers without a GPU draw every pixel on the processor: an environment map, shadows, a sky or a sheet of
        # water would leave 2 pictures a second instead of 25.
        self._scene.configure_environment_map(None)
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.add_light_ambient("/light", intensity=0.6)
        self._look(server, middle)

    @property
    def grips(self) -> list[Grip]:
        """What can be dragged; the first one is the hand."""
        names = {k: self._model.body(self._model.geom_bodyid[k]).name for k in self._geoms}
        return [
            Grip(self._led.hand, self._hand, is_hand=True),
            *(Grip(names[k], handle) for k, handle in self._geoms.items()),
        ]

    def ground(self, points: Array, layer: int = 0) -> Array:
        """``(..., 3)`` m, where places ``(..., outcome_dim)`` of T are in the scene."""
        points = np.asarray(points)
        flat = np.zeros((*points.shape[:-1], 3))
        flat[..., : min(2, points.shape[-1])] = points[..., :2]
        flat[..., 2] = layer * ABOVE * self.size
        return flat

    def place(self, origin: Array, direction: Array) -> Array | None:
        """``(outcome_dim,)`` in T at which a ray meets the ground; None if it does not, or beside T."""
        if abs(direction[2]) < 1e-9 or -origin[2] / direction[2] <= 0:
            return None
        hit = origin - origin[2] / direction[2] * direction
        place = (self._outcomes.low + self._outcomes.high) / 2
        place[: min(2, self._outcomes.dim)] = hit[: min(2, self._outcomes.dim)]
        return place if self._outcomes.contains(place) else None

    def draw_arm(self, data: Any, hand: Array) -> None:
        """The led robot in the posture of ``data``, its hand at ``(3,)`` m."""
        if np.array_equal(data.geom_xpos, self._drawn):
            return
        self._drawn = data.geom_xpos.copy()
        for k, handle in self._geoms.items():
            handle.position, handle.wxyz = data.geom_xpos[k], _quaternion(data.geom_xmat[k])
        if self._thin.size:
            axes = data.geom_xmat[self._thin].reshape(-1, 3, 3)[:, :, 2] * self._model.geom_size[self._thin, 1:2]
            middles = data.geom_xpos[self._thin]
            self._line.points = np.stack([middles - axes, middles + axes], axis=1).astype(np.float32)
        self._hand.position = hand
        if self._hint.visible:
            self._hint.position = hand + np.array([0, 0, 0.04 * self.size])

    def hide_hint(self) -> None:
        """Nobody has to be told any more what can be dragged."""
        if self._hint.visible:
            self._hint.visible = False

    def draw_ghost(self, chain: Array | None, end: Array | None) -> None:
        """The learner's robot: ``(n, 2, 3)`` m lines and where its end or float is; None hides it."""
        _put(self._ghost, chain)
        self._ghost_end.visible = end is not None
        if end is not None:
            self._ghost_end.position = end

    def draw_best(self, chain: Array | None) -> None:
        """The best try at a goal that was asked for, ``(n, 2, 3)`` m; None hides it."""
        _put(self._best, chain)

    def draw_trace(self, path: Array | None) -> None:
        """The way ``(n, 3)`` m of the hand in a recording; None hides it."""
        _put(self._trace, None if path is None or len(path) < 2 else np.stack([path[:-1], path[1:]], axis=1))

    def draw_map(self, colours: Colours, met: NDArray[np.bool_]) -> None:
        """Another picture on the ground, and on it the goals of the benchmark; ``met`` ``(n,)`` are within reach."""
        picture = _smooth(colours, PIXELS)
        for (row, column), reached in zip(self._places, met, strict=True):
            here = slice(row - DOT, row + DOT + 1), slice(column - DOT, column + DOT + 1)
            picture[here][_DISC[: picture[here].shape[0], : picture[here].shape[1]]] = MET if reached else UNMET
        self.map.image = picture

    def draw_landings(self, outcomes: Array) -> None:
        """Where the last movements ended, ``(n, outcome_dim)``."""
        self._landings.visible = len(outcomes) > 0
        if len(outcomes):
            self._landings.points = self.ground(outcomes, 5).astype(np.float16)
            self._landings.colors = np.tile(np.array(LEARNER, dtype=np.uint8), (len(outcomes), 1))

    def mark(self, name: str, place: Array | None, text: str = "") -> None:
        """Put "goal", "landed", "expected", "asked" or "lesson" at a place of T, or hide it; with a text beside it."""
        mark, label = self._marks[name], self._labels[name]
        mark.visible = place is not None
        label.visible = place is not None and bool(text)
        if place is not None:
            mark.position = self.ground(place, 3)
            label.position, label.text = self.ground(place, 3), text or " "

    def _sides(self) -> tuple[float, float]:
        sides = self._outcomes.sides
        return float(sides[0]), float(sides[1] if len(sides) > 1 else sides[0] / 10)

    def _pixels(self, goals: Array, outcomes: Box) -> NDArray[np.int64]:
        """``(n, 2)`` rows and columns of the map's picture at which goals lie."""
        shares = np.full((len(goals), 2), 0.5)
        k = min(2, outcomes.dim)
        shares[:, :k] = (goals[:, :k] - outcomes.low[:k]) / outcomes.sides[:k]
        n = CELLS * PIXELS
        return np.stack([(1 - shares[:, 1]) * n, shares[:, 0] * n], axis=1).astype(np.int64).clip(DOT, n - DOT - 1)

    def _points(self, name: str, points: Array, colour: tuple[int, int, int], size: float) -> Any:
        colours = np.tile(np.array(colour, dtype=np.uint8), (len(points), 1))
        return self._scene.add_point_cloud(
            name, points, colours, point_size=size * self.size, point_shape="circle", point_shading="flat"
        )

    def _lines(self, name: str, n: int, colour: tuple[int, int, int], thickness: float) -> Any:
        return self._scene.add_line_segments(name, np.zeros((max(n, 1), 2, 3)), colour, thickness=thickness)

    def _ball(self, name: str, colour: tuple[int, int, int], radius: float) -> Any:
        return self._scene.add_icosphere(name, radius=radius, color=colour, subdivisions=3)

    def _ring(self, name: str, colour: tuple[int, int, int], radius: float) -> Any:
        ring = trimesh.creation.torus(radius * self.size, 0.006 * self.size, 32, 8)
        return self._scene.add_mesh_simple(name, ring.vertices, ring.faces, color=colour, cast_shadow=False)

    def _label(self, name: str) -> Any:
        return self._scene.add_label(f"/label/{name}", " ", anchor="bottom-left", visible=False)

    def _add_geom(self, k: int) -> Any:
        shape = _shape(self._model, k)
        colour = np.round(255 * _rgba(self._model, k)[:3]).astype(np.uint8)
        return self._scene.add_mesh_simple(f"/arm/{k}", shape.vertices, shape.faces, color=colour)

    def _look(self, server: viser.ViserServer, middle: Array) -> None:
        """From the shore, or from above where the robot lies in the plane."""
        data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, data)
        flat = float(np.ptp(data.xpos[1:, 2])) < 1e-6 and abs(float(data.xpos[1, 2])) < 1e-6
        away = np.array([0.0, -0.01, 1.05]) if flat else np.array([0.32, -0.92, 0.66])
        server.initial_camera.position = tuple(middle + away * self.size)
        server.initial_camera.look_at = tuple(middle + np.array([0.0, 0.0 if flat else 0.06, 0.0]) * self.size)
        server.scene.set_up_direction("+z" if not flat else "+y")


def _shape(model: Any, k: int) -> Any:
    """A geom as a mesh."""
    kind, size, make = mujoco.mjtGeom(model.geom_type[k]), model.geom_size[k], trimesh.creation
    match kind:
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return make.capsule(radius=size[0], height=2 * size[1], count=[16, 16], transform=None)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return make.cylinder(radius=size[0], height=2 * size[1], sections=32)
        case mujoco.mjtGeom.mjGEOM_BOX:
            return make.box(extents=2 * size)
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[k]
            first, n = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            face, m = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
            return trimesh.Trimesh(model.mesh_vert[first : first + n], model.mesh_face[face : face + m], process=False)
    ball = make.icosphere(subdivisions=2)
    ball.apply_scale(size if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID else size[0])
    return ball


def _rgba(model: Any, k: int) -> Array:
    material = model.geom_matid[k]
    return np.asarray(model.geom_rgba[k] if material < 0 else model.mat_rgba[material])


def _quaternion(matrix: Array) -> Array:
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.asarray(matrix).ravel())
    return found


def _put(lines: Any, segments: Array | None) -> None:
    lines.visible = segments is not None
    if segments is not None:
        lines.points = np.asarray(segments, dtype=np.float32)


def _smooth(colours: Colours, times: int) -> Colours:
    """A picture so many times as large, without steps between its cells."""
    n = len(colours)
    if times == 1:
        return colours.copy()
    places = np.clip((np.arange(n * times) + 0.5) / times - 0.5, 0, n - 1)
    low = np.minimum(places.astype(np.int64), n - 2)
    share = (places - low)[:, None, None]
    tall = (1 - share) * colours[low] + share * colours[low + 1]
    share = share.reshape(1, -1, 1)
    return ((1 - share) * tall[:, low] + share * tall[:, low + 1]).astype(np.uint8)
