"""Films of the fishing rod: the arm casts, the line swings, the float lands near its goal.

Section 4 of Nguyen & Oudeyer (2014). A film shows, in real time, movements that ``FishingRod.trace`` has simulated.
Line and float are drawn thicker than in the model, to be visible. ``fishing_rod.xml`` defines lights and materials.
    with Camera(rod.model) as camera: write_film(Path("film.mp4"), shoot(camera, [Shot(recording, goal)]))

Needs the extra ``film`` and OpenGL: without a display, set MUJOCO_GL=egl before the first import of mujoco.
"""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final, Self

import mujoco
import numpy as np
from PIL import Image

from sgimd_torch.environments.rod_physics import RodTrace
from sgimd_torch.extras.film.reel import HEIGHT, WIDTH, Shot
from sgimd_torch.spaces import Array

MOST_PAST: Final = 250  # largest number of past landings in a frame; 250 landings double the time of drawing a frame

Colour = tuple[float, float, float, float]  # red, green, blue, opacity
LINE: Final = (0.06, 0.06, 0.08, 1.0)  # colour of the fishing line
FLOAT: Final = (0.92, 0.24, 0.02, 1.0)  # colour of the float
PATH: Final = (0.6, 0.28, 0.12, 1.0)  # colour of the float's path
RING: Final = (0.85, 0.93, 0.97, 0.45)  # colour of the circles around the arm
GOAL: Final = (0.94, 0.89, 0.26, 1.0)  # colour of the goal
PAST: Final = (0.92, 0.96, 1.0, 0.7)  # colour of past outcomes


class MujocoPainter:
    """A context manager that draws states of a model, without a window, in the size of a film.

    Args:
        model: MuJoCo model; it is not changed.

    Raises:
        ImportError: OpenGL is not available in the form that the variable MUJOCO_GL names.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = copy.copy(model)
        size = self._model.vis.global_  # a model may ask for smaller pictures
        size.offwidth, size.offheight = max(WIDTH, size.offwidth), max(HEIGHT, size.offheight)
        self._data = mujoco.MjData(self._model)
        try:
            self._renderer = mujoco.Renderer(self._model, HEIGHT, WIDTH)
        # Each OpenGL library fails in a different way.
        except (mujoco.FatalError, AttributeError, RuntimeError, ImportError) as error:
            raise ImportError(
                f"MuJoCo finds no OpenGL to draw with (MUJOCO_GL={os.environ.get('MUJOCO_GL', '')}: {error}); without "
                "a display set MUJOCO_GL=egl and install libegl1 (Debian, Ubuntu), or MUJOCO_GL=osmesa and libosmesa6"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def _at(self, state: Array) -> mujoco.MjData:
        mujoco.mj_setState(self._model, self._data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_forward(self._model, self._data)
        return self._data


class Camera(MujocoPainter):
    """A `Painter` of shots of the rod, whose ``model`` it gets."""

    def __init__(self, model: mujoco.MjModel) -> None:
        super().__init__(model)
        for name in ("line", "float"):  # hidden here, because ``frame`` draws both thicker
            self._model.material(name).rgba[3] = 0.0
        self._tip = self._model.site("tip").id
        self._line = [self._model.body(f"line_{k:02}").id for k in range(2, 31)]

    def frame(self, shot: Shot, time: float) -> Image.Image:
        """The scene at ``time`` (s); after the landing, the scene at the landing.

        The picture shows arm, line, float and the path of the float. On the water it shows the goal, past landings, and
        circles with radii of 0.5 m and 1 m around the arm.
        """
        recording = shot.recording
        assert isinstance(recording, RodTrace)
        time = min(time, recording.landed)
        row = min(round(time / recording.step), len(recording.states) - 1)
        self._renderer.update_scene(self._at(recording.states[row]), camera="shore")
        scene, float_at_time = self._renderer.scene, recording.float_at(time)
        for radius in (0.5, 1.0):
            draw_chain(scene, _circle(np.zeros(2), radius), 0, RING)
        for landing in shot.past[:: max(1, math.ceil(len(shot.past) / MOST_PAST))]:
            add_geom(scene, mujoco.mjtGeom.mjGEOM_BOX, (0.007, 0.007, 0.001), np.append(landing, 0.001), PAST)
        draw_chain(scene, _circle(shot.goal, 0.06), 0.008, GOAL)
        draw_chain(scene, [*(recording.float_at(t) for t in np.arange(0.0, time, 0.02)), float_at_time], 0, PATH)
        loose = recording.let_out is not None and time > recording.let_out
        hinges = [] if loose else self._data.xpos[self._line]
        draw_chain(scene, [self._data.site_xpos[self._tip], *hinges, float_at_time], 0.003, LINE)
        add_geom(scene, mujoco.mjtGeom.mjGEOM_SPHERE, (0.026, 0, 0), float_at_time, FLOAT).emission = 0.4
        if time == recording.landed:
            draw_chain(scene, [np.append(shot.goal, 0.006), np.append(recording.outcome, 0.006)], 0.005, GOAL)
        return Image.fromarray(self._renderer.render())


def _circle(centre: Array, radius: float) -> Array:
    angles = np.linspace(0, 2 * np.pi, 60)
    return np.append(centre, 0.004) + radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)


def draw_chain(scene: mujoco.MjvScene, points: Sequence[Array] | Array, radius: float, colour: Colour) -> None:
    """Join points by rods of a ``radius`` (m); a radius of 0 draws lines, which is faster."""
    kind, width = (mujoco.mjtGeom.mjGEOM_CAPSULE, radius) if radius else (mujoco.mjtGeom.mjGEOM_LINE, 2)  # pixels
    for start, stop in pairwise(points):
        mujoco.mjv_connector(add_geom(scene, kind, (width, 0, 0), start, colour), kind, width, start, stop)


def add_geom(scene: mujoco.MjvScene, kind: int, size: Sequence[float], position: Array, colour: Colour) -> Any:
    """Add a geom to the scene; MuJoCo defines the meaning of ``size`` (m) for each ``kind``."""
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.array(size), position, np.eye(3).ravel(), np.array(colour, np.float32))
    scene.ngeom += 1
    return geom
