"""The scene: the robot that a hand leads, and the map of T on the ground.

    scene = Scene(server, led, links, outcomes, goals); scene.draw_arm(leading.data, leading.hand)
The map of T lies in the plane z = 0 of the model, at the places of the outcomes, so movements end on the map.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final

import mujoco
import numpy as np
import trimesh
import viser
from viser.transforms import SO3

from sgimd_torch.spaces import Array, Box
from sgimd_torch.teach.chart import CELLS, SKILL, Chart, by_error
from sgimd_torch.teach.led import HandLed

HAND, LEARNER, MET, UNMET = (240, 120, 30), (60, 70, 190), (10, 110, 50), (120, 140, 160)
ABOVE: Final = 0.002  # distance from one layer of the map to the next, as a share of the map's longer side
SEEN: Final = 1e-4  # share of the map's longer side; a robot that has moved less is not drawn again


class Scene:
    """The robot and the map of T, drawn in a browser.

    Args:
        server: web server of the page.
        led: model and led joints of the robot.
        links: names of the bodies that a hand leads; other bodies, such as the line of the rod, are not drawn.
        outcomes: T.
        goals: ``(n_goals, outcome_dim)`` goals of the benchmark.

    Attributes:
        grips: name and picture of each body that can be dragged, the hand first.
    """

    def __init__(
        self, server: viser.ViserServer, led: HandLed, links: Collection[str], outcomes: Box, goals: Array
    ) -> None:
        self._scene, self._outcomes = server.scene, outcomes
        self._model = model = led.model
        self.size = float(outcomes.sides[:2].max())
        middle = self.ground((outcomes.low + outcomes.high) / 2)
        blank = np.full((CELLS, CELLS, 3), SKILL[0], dtype=np.uint8)
        width = outcomes.sides[0]
        height = outcomes.sides[1] if outcomes.dim > 1 else width / 10
        self.map = self._scene.add_image("/map", blank, width, height, format="png", wxyz=(0, 1, 0, 0), position=middle)
        self._goals = self._points("/goals", self.ground(goals, 3), UNMET, 0.006)
        self._landings = self._points("/landings", np.zeros((1, 3)), LEARNER, 0.01)
        led_bodies = {model.body(name).id for name in links}
        shown = [k for k in range(model.ngeom) if model.geom_bodyid[k] in led_bodies]
        self._drawn = np.full((model.ngeom, 3), np.inf)
        self._geoms = {k: self._add_geom(k) for k in shown}
        self._hand = self._scene.add_icosphere("/hand", radius=0.026 * self.size, color=HAND, subdivisions=3)
        ring = trimesh.creation.torus(0.03 * self.size, 0.006 * self.size, 32, 8)
        self._mark = self._scene.add_mesh_simple("/mark", ring.vertices, ring.faces, color=HAND, visible=False)
        names = [model.body(model.geom_bodyid[k]).name for k in shown]
        self.grips = [(led.hand, self._hand), *zip(names, self._geoms.values(), strict=True)]
        # Without a GPU a browser draws 25 pictures a second, but only two with environment map, shadows or water.
        self._scene.configure_environment_map(None)
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.add_light_ambient("/light", intensity=0.6)
        self._look(server, middle)

    def ground(self, points: Array, layer: int = 0) -> Array:
        """Scene points ``(..., 3)`` m of places ``(..., outcome_dim)`` in T; a greater ``layer`` lies higher."""
        points = np.asarray(points)
        flat = np.zeros((*points.shape[:-1], 3))
        flat[..., : min(2, points.shape[-1])] = points[..., :2]
        flat[..., 2] = layer * ABOVE * self.size
        return flat

    def draw_arm(self, data: Any, hand: Array) -> None:
        """Draw the robot in the posture of ``data``, and its ``hand`` ``(3,)`` m."""
        if np.allclose(data.geom_xpos, self._drawn, rtol=0, atol=SEEN * self.size):
            return
        self._drawn = data.geom_xpos.copy()
        for k, handle in self._geoms.items():
            handle.position = data.geom_xpos[k]
            handle.wxyz = SO3.from_matrix(data.geom_xmat[k].reshape(3, 3)).wxyz
        self._hand.position = hand

    def draw_map(self, chart: Chart) -> None:
        """Draw the map of predicted errors on the ground, and the goals of the benchmark on the map."""
        self.map.image = by_error(chart, self._outcomes)
        self._goals.colors = np.where(chart.met[:, None], MET, UNMET).astype(np.uint8)

    def draw_landings(self, outcomes: Array) -> None:
        """Draw the latest ``outcomes`` ``(n, outcome_dim)``."""
        self._landings.visible = len(outcomes) > 0
        if len(outcomes):
            self._landings.points = self.ground(outcomes, 5).astype(np.float16)

    def mark(self, place: Array | None) -> None:
        """Draw the ring of a lesson at a ``place`` ``(outcome_dim,)`` of T; None hides it."""
        self._mark.visible = place is not None
        if place is not None:
            self._mark.position = self.ground(place, 3)

    def _points(self, name: str, points: Array, colour: tuple[int, int, int], size: float) -> Any:
        return self._scene.add_point_cloud(
            name, points, colour, point_size=size * self.size, point_shape="circle", point_shading="flat"
        )

    def _add_geom(self, k: int) -> Any:
        shape = _shape(self._model, k)
        colour = np.round(255 * _rgba(self._model, k)[:3]).astype(np.uint8)
        return self._scene.add_mesh_simple(f"/arm/{k}", shape.vertices, shape.faces, color=colour)

    def _look(self, server: viser.ViserServer, middle: Array) -> None:
        """Place the camera: on the shore, or above a robot that lies in the plane of the map."""
        data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, data)
        flat = float(np.ptp(data.xpos[1:, 2])) < 1e-6 and abs(float(data.xpos[1, 2])) < 1e-6
        away = np.array([0.0, -0.01, 1.05]) if flat else np.array([0.32, -0.92, 0.66])
        server.initial_camera.position = tuple(middle + away * self.size)
        server.initial_camera.look_at = tuple(middle + np.array([0.0, 0.0 if flat else 0.06, 0.0]) * self.size)
        server.scene.set_up_direction("+z" if not flat else "+y")


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
