"""Films of robots from model files: MuJoCo draws robot and objects, with the goal, T and the path between them.

    with ModelCamera(robot, shots) as camera: write_film(Path("film.mp4"), shoot(camera, shots))
The model's own camera is used if it is fixed to the world and sees all of T. Else a camera is placed where it does. A
model without a floor or a light gets them, because shadows on a floor show how far away things are. The floor is light
or dark, whichever differs more from the robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, product
from typing import Final

import mujoco
import numpy as np
from PIL import Image

from sgimd_torch.extras.film.camera import GOAL, MOST_PAST, Colour, MujocoPainter, add_geom, draw_chain
from sgimd_torch.extras.film.reel import HEIGHT, WIDTH, Shot
from sgimd_torch.extras.models.mujoco_robot import Filmed, MujocoRobot
from sgimd_torch.spaces import Array

FILLED: Final = 0.8  # share of the picture, in height and width, that shows robot and T
BORDER: Final = (0.08, 0.28, 0.36, 1.0)  # colour of the border of T
PATH: Final = (0.65, 0.32, 0.13, 1.0)  # colour of the paths of measured places
FLOORS: Final = ((0.66, 0.71, 0.76, 1.0), (0.16, 0.22, 0.3, 1.0))  # colours of a floor that we add, light and dark
REACHED: Final = (0.8, 0.2, 0.6, 1.0)  # colour of past outcomes, unlike that of anything else
END: Final = (0.82, 0.2, 0.12, 1.0)  # colour of the measured places
BALL: Final = mujoco.mjtGeom.mjGEOM_SPHERE


class ModelCamera(MujocoPainter):
    """A `Painter` of shots of a robot from a model file.

    Args:
        robot: robot of the shots.
        shots: all shots of the film; one camera sees them all.
    """

    def __init__(self, robot: MujocoRobot, shots: Sequence[Shot]) -> None:
        super().__init__(robot.model)
        self._robot = robot
        if not self._model.nlight:
            light = self._model.vis.headlight
            light.ambient[:], light.diffuse[:] = 0.4, 0.2
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False  # slow
        corners = np.concatenate([_edges(robot, shot).reshape(-1, 3) for shot in shots])
        arm = [self._at(state).xpos[robot.bodies] for shot in shots for state in _filmed(shot).states[::5]]
        seen = np.concatenate([corners, *arm])
        self._camera = viewing(self._model, self._data, seen)
        self._far = float(np.ptp(seen, axis=0).max())
        self._at(_filmed(shots[0]).states[0])
        low = (self._data.geom_xpos[:, 2] - self._model.geom_rbound)[self._model.geom_rbound > 0]
        self._ground = np.append(seen.mean(axis=0)[:2], min(seen[:, 2].min(), low.min(initial=np.inf)))
        self._ground[2] -= 0.002 * self._far  # below a plane of the model
        self._floor: Colour | None = None
        self._floor = self._contrasting_floor()

    def frame(self, shot: Shot, time: float) -> Image.Image:
        """The scene at ``time`` (s); after the end of the movement, the last state and the outcome.

        The picture shows robot and objects, the border of T, the goal, past outcomes, and the path of each measured
        place.
        """
        recording, start = _filmed(shot), self._robot.start_in(shot.context)
        row = min(round(time / recording.step), len(recording.states) - 1)
        self._renderer.update_scene(self._at(recording.states[row]), camera=self._camera)
        scene, size = self._renderer.scene, 0.012 * self._far
        self._furnish(scene)
        for edge in _edges(self._robot, shot):
            draw_chain(scene, edge, 0, BORDER)
        for place in self._robot.located(shot.past[:: max(1, math.ceil(len(shot.past) / MOST_PAST))], start).reshape(
            -1, 3
        ):
            ball = add_geom(scene, BALL, (size / 2, 0, 0), place, REACHED)
            ball.emission, ball.category = 0.5, mujoco.mjtCatBit.mjCAT_DECOR
        for k, goal in enumerate(self._robot.located(shot.goal[None], start)[0]):
            path = recording.path[: row + 1, k]
            draw_chain(scene, path, 0, PATH)
            add_geom(scene, BALL, (1.6 * size, 0, 0), goal, (*GOAL[:3], 0.6)).emission = 0.4
            add_geom(scene, BALL, (0.8 * size, 0, 0), path[-1], END).emission = 0.4
            if time >= recording.landed:
                draw_chain(scene, [goal, path[-1]], 0.4 * size, GOAL)
        return Image.fromarray(self._renderer.render())

    def _contrasting_floor(self) -> Colour:
        """The one of ``FLOORS`` that differs more from the robot, as the camera sees it without a floor."""
        self._renderer.update_scene(self._data, camera=self._camera)
        self._furnish(self._renderer.scene)
        seen = self._renderer.render()
        self._renderer.enable_segmentation_rendering()
        geoms, kinds = np.moveaxis(self._renderer.render(), -1, 0)
        self._renderer.disable_segmentation_rendering()
        robot = (kinds == mujoco.mjtObj.mjOBJ_GEOM) & np.isin(self._model.geom_bodyid[geoms], self._robot.bodies)
        brightness = seen[robot].mean() / 255 if robot.any() else 0.0
        return max(FLOORS, key=lambda floor: abs(brightness - sum(floor[:3]) / 3))

    def _furnish(self, scene: mujoco.MjvScene) -> None:
        """Add a floor where nothing is behind the robot, and a light with shadows, if the model has none."""
        model, far = self._model, self._far
        endless = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_size[:, :2] == 0).all(axis=1)
        if self._floor and not endless.any() and mujoco.mjtTexture.mjTEXTURE_SKYBOX not in model.tex_type:
            add_geom(scene, mujoco.mjtGeom.mjGEOM_PLANE, (9 * far, 9 * far, 1), self._ground, self._floor)
        if not model.nlight:
            light = scene.lights[scene.nlight]
            light.pos[:], light.dir[:] = self._ground + np.array([far, -far, 4 * far]), (-0.24, 0.24, -0.94)
            light.ambient[:], light.diffuse[:], light.specular[:] = 0.0, 0.5, 0.1
            light.type, light.headlight, light.castshadow = mujoco.mjtLightType.mjLIGHT_SPOT, 0, 1
            light.attenuation[:], light.cutoff, light.exponent = (1, 0, 0), 80, 0
            scene.nlight += 1


def viewing(model: mujoco.MjModel, data: mujoco.MjData, points: Array) -> int | mujoco.MjvCamera:
    """A camera that sees ``points`` ``(n, 3)`` m: the first camera of the model that is fixed to the world and does.

    If there is none, it is the nearest camera in the direction in which MuJoCo's viewer first looks at the model.
    """
    for k in np.flatnonzero(model.cam_bodyid == 0).tolist():
        x, y, z = ((points - data.cam_xpos[k]) @ data.cam_xmat[k].reshape(3, 3)).T
        reach = -z * math.tan(math.radians(model.cam_fovy[k]) / 2)  # a camera looks along its -z
        if ((np.abs(y) < reach) & (np.abs(x) < WIDTH / HEIGHT * reach)).all():
            return int(k)
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    turn, tilt = math.radians(camera.azimuth), math.radians(camera.elevation)
    ahead = np.array([math.cos(tilt) * math.cos(turn), math.cos(tilt) * math.sin(turn), math.sin(tilt)])
    right = np.array([math.sin(turn), -math.cos(turn), 0.0])
    camera.lookat[:] = (points.min(axis=0) + points.max(axis=0)) / 2
    away = points - camera.lookat
    across, along = np.abs(away @ right) * HEIGHT / WIDTH, np.abs(away @ np.cross(right, ahead))
    slope = FILLED * math.tan(math.radians(model.vis.global_.fovy) / 2)
    camera.distance = float((np.maximum(across, along) / slope - away @ ahead).max())
    return camera


def _edges(robot: MujocoRobot, shot: Shot) -> Array:
    """``(n_edges, 2, 3)`` m, the edges of T in the world, for each measured place."""
    corners = np.array(list(product(*zip(robot.outcomes.low, robot.outcomes.high, strict=True))))
    ends = [[k, j] for k, j in combinations(range(len(corners)), 2) if (corners[k] != corners[j]).sum() == 1]
    edges = robot.located(corners, robot.start_in(shot.context))[ends].swapaxes(1, 2).reshape(-1, 2, 3)
    return np.unique(edges[(edges[:, 0] != edges[:, 1]).any(axis=1)], axis=0)


def _filmed(shot: Shot) -> Filmed:
    assert isinstance(shot.recording, Filmed)
    return shot.recording
