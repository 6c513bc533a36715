"""The scene: the robot that a hand leads, its objects, and the map of T.

    scene = Scene(server, led, arm, outcomes, goals); scene.draw_arm(arm.data, leading.hand)
The map lies at the places of the outcomes, so movements end on the map, or above it if T has three dimensions.
"""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
import trimesh
import viser
from viser.transforms import SO3

from sgimd_torch.extras.teach.arm import Arm
from sgimd_torch.extras.teach.chart import CELLS, COLOURS, Chart, picture_of
from sgimd_torch.extras.teach.led import HandLed
from sgimd_torch.spaces import Array, Box, rounded

HAND: Final = (240, 120, 30)  # colour of the robot's hand and of the lesson's outcome
LEARNER: Final = (60, 70, 190)  # colour of the learner's latest outcomes
REACHED: Final = (10, 110, 50)  # colour of goals within reach
TOO_FAR: Final = (120, 140, 160)  # colour of goals out of reach, and of the axes
ABOVE: Final = 0.002  # distance from one layer of the map to the next, as a share of the map's longer side
NUMBERS: Final = 5  # largest number of steps between the numbers of an axis
CAMERA: Final = np.array([0.32, -0.92, 0.66])  # from the middle of the scene, in sizes of the scene
VISIBLE: Final = 1e-4  # share of the map's longer side; a robot that has moved less is not drawn again


class Scene:
    """The robot, its objects and the map of T, drawn in a browser.

    Args:
        server: web server of the page.
        led: model and led joints of the robot.
        arm: the arm in its present posture.
        outcomes: T.
        goals: ``(n_goals, outcome_dim)`` goals of the benchmark.

    Attributes:
        grips: name and picture of each body that can be dragged, the hand first.
    """

    def __init__(self, server: viser.ViserServer, led: HandLed, arm: Arm, outcomes: Box, goals: Array) -> None:
        self._scene, self._outcomes, self._led, self._model = server.scene, outcomes, led, led.model
        origin = self._placed(outcomes.low)
        edges = self._placed(outcomes.low + np.diag(outcomes.sides)) - origin  # (outcome_dim, 3) m, of T in the world
        along, across = edges[0], edges[min(1, outcomes.dim - 1)]
        if outcomes.dim == 1 or not across.any():  # then the map is a strip
            across = np.cross([0, -1, 0] if along[2] else [0, 0, 1], along) / 10
        self._up = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
        self._up *= np.sign(self._up @ CAMERA)
        links = [arm.data.body(name).xpos for name in arm.links]
        plane = [origin, origin + along, origin + across, origin + along + across]
        corners = np.stack([*plane, self._placed(outcomes.high), *links])
        self.size = float(np.ptp(corners, axis=0).max())
        self._add_map(origin, along, across, edges)
        self._goals = self._points("/goals", self.ground(goals, 3), TOO_FAR, 0.006)
        self._latest = self._points("/latest", np.zeros((1, 3)), LEARNER, 0.01)
        names = [self._model.body(k).name for k in self._model.geom_bodyid]
        visible = [k for k, name in enumerate(names) if name not in led.hidden and _is_visible(self._model, k)]
        self._drawn = np.full((self._model.ngeom, 3), np.inf)
        self._geoms = {k: self._add_geom(k) for k in visible}
        self._hand = self._scene.add_icosphere("/hand", radius=0.026 * self.size, color=HAND, subdivisions=3)
        ring = trimesh.creation.torus(0.03 * self.size, 0.006 * self.size, 32, 8)
        self._mark = self._scene.add_mesh_simple("/mark", ring.vertices, ring.faces, color=HAND, visible=False)
        grips = [(names[k], handle) for k, handle in self._geoms.items() if names[k] in arm.links]
        self.grips = [(led.hand, self._hand), *grips]
        # Without a GPU a browser draws 25 pictures a second, but only two with environment map, shadows or water.
        self._scene.configure_environment_map(None)
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.add_light_ambient("/light", intensity=0.6)
        flat = float(np.ptp(corners[:, 2])) < 1e-6  # then the camera looks from above
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        away = np.array([0, -0.01, 1.05]) if flat else CAMERA * (1.3 if outcomes.dim > 2 else 1.0)
        server.initial_camera.position = tuple(middle + self.size * away)
        server.initial_camera.look_at = tuple(middle)
        server.scene.set_up_direction("+y" if flat else "+z")

    def ground(self, points: Array, layer: int = 0) -> Array:
        """Scene points ``(..., 3)`` m of places ``(..., outcome_dim)`` in T; a greater ``layer`` lies higher."""
        return self._placed(points) + layer * ABOVE * self.size * self._up

    def draw_arm(self, data: Any, hand: Array) -> None:
        """Draw the robot in the posture of ``data``, and its ``hand`` ``(3,)`` m."""
        if np.allclose(data.geom_xpos, self._drawn, rtol=0, atol=VISIBLE * self.size):
            return
        self._drawn = data.geom_xpos.copy()
        for k, handle in self._geoms.items():
            handle.position = data.geom_xpos[k]
            handle.wxyz = SO3.from_matrix(data.geom_xmat[k].reshape(3, 3)).wxyz
        self._hand.position = hand

    def draw_map(self, chart: Chart) -> None:
        """Draw the map on the ground, and the goals of the benchmark on the map."""
        self.map.image = picture_of(chart, self._outcomes)
        self._goals.colors = np.where(chart.reached[:, None], REACHED, TOO_FAR).astype(np.uint8)

    def draw_outcomes(self, outcomes: Array) -> None:
        """Draw the learner's latest ``outcomes`` ``(n, outcome_dim)``."""
        self._latest.visible = len(outcomes) > 0
        if len(outcomes):
            self._latest.points = self.ground(outcomes, 5).astype(np.float16)

    def mark(self, point: Array | None) -> None:
        """Draw the ring of a lesson at a ``point`` ``(outcome_dim,)`` of T; None hides it."""
        self._mark.visible = point is not None
        if point is not None:
            self._mark.position = self.ground(point, 3)

    def _points(self, name: str, points: Array, colour: tuple[int, int, int], size: float) -> Any:
        return self._scene.add_point_cloud(
            name, points, colour, point_size=size * self.size, point_shape="circle", point_shading="flat"
        )

    def _add_geom(self, k: int) -> Any:
        shape = _shape(self._model, k)
        colour = np.round(255 * _rgba(self._model, k)[:3]).astype(np.uint8)
        return self._scene.add_mesh_simple(f"/arm/{k}", shape.vertices, shape.faces, color=colour)

    def _placed(self, points: Array) -> Array:
        """Positions ``(..., 3)`` m in the world of points ``(..., outcome_dim)`` of T."""
        rows = np.reshape(points, (-1, self._outcomes.dim))
        return self._led.located(rows).reshape(*np.shape(points)[:-1], 3)

    def _add_map(self, origin: Array, along: Array, across: Array, edges: Array) -> None:
        """Add the map, with numbers and names at the ``edges`` of T that begin at ``origin`` and have a direction."""
        width, height = float(np.linalg.norm(along)), float(np.linalg.norm(across))
        x, y = along / width, -across / height  # of the picture, whose first row is the upper one
        self.map = self._scene.add_image(
            "/map",
            np.full((CELLS, CELLS, 3), COLOURS[0], dtype=np.uint8),
            *(width, height),
            format="png",
            wxyz=SO3.from_matrix(np.stack([x, y, np.cross(x, y)], axis=1)).wxyz,
            position=origin + (along + across) / 2,
        )
        for k in np.flatnonzero(edges[:3].any(axis=1)).tolist():
            edge, low, high, outwards = edges[k], self._outcomes.low[k], self._outcomes.high[k], (y, -x, y - x)[k]
            beside = origin + 0.04 * self.size * outwards
            step = rounded((high - low) / NUMBERS)
            for value in step * np.arange(np.ceil(low / step), np.floor(high / step) + 1):
                position = beside + (value - low) / (high - low) * edge
                self._label(f"/axes/{k}/{value:g}", f"{value + 0.0:g}", position)
            self._label(f"/axes/{k}/name", self._outcomes.axis(k), beside + edge / 2 + 0.06 * self.size * outwards)
            self._scene.add_line_segments(
                f"/axes/{k}/line", np.stack([origin, origin + edge])[None], TOO_FAR, thickness=0.003 * self.size
            )

    def _label(self, name: str, text: str, position: Array) -> None:
        self._scene.add_label(name, text, position=position, anchor="center-center", font_screen_scale=0.8)


def _is_visible(model: Any, k: int) -> bool:
    """Whether a viewer of MuJoCo shows geom ``k`` at first; floors are left out, as the map lies there."""
    floor = mujoco.mjtGeom(model.geom_type[k]) in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    return bool(not floor and model.geom_group[k] <= 2 and _rgba(model, k)[3] > 0)


def _shape(model: Any, k: int) -> Any:
    """Geom ``k`` as a mesh."""
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
