"""Films of the fishing rod: the arm casts, the line swings, the float lands near its goal.

Section 4 of Nguyen & Oudeyer (2014). A film shows what ``FishingRod.record`` has simulated, in real time. Line and
float are drawn thicker than they are, so that they can be seen. Light, shadow and reflection are those of
``fishing_rod.xml``; the ripples of the water, and the rings around a float that has landed, are drawn only here.
    with Camera(rod.model) as camera: write_film("film.mp4", shoot(camera, [Shot(recording, goal)]))

Needs the extra ``film``, and OpenGL: without a display, set MUJOCO_GL=egl before anything imports mujoco.
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

from sgimd_torch.environments.rod_physics import Recording
from sgimd_torch.spaces import Array, stream
from sgimd_torch.views.film.reel import Frame, Shot, captioned, place

MOST_PAST: Final = 250  # landings that are drawn: this many take as much time as all the rest

_Colour = tuple[float, float, float, float]
_INK, _FLOAT, _GOAL, _PATH = (0.06, 0.06, 0.08, 1), (0.92, 0.24, 0.02, 1), (0.94, 0.89, 0.26, 1), (0.6, 0.28, 0.12, 1)
_PAST, _RING, _STONE = (0.92, 0.96, 1, 0.7), (0.85, 0.93, 0.97, 0.45), (0.52, 0.52, 0.50, 1)
_DEEP, _SHALLOW = np.array([16.0, 78.0, 108.0]), np.array([52.0, 128.0, 150.0])  # red, green, blue of the water
_WAVES: Final = 60  # that a texture of the water is the sum of


class NoGraphics(ImportError):
    """MuJoCo finds no OpenGL to draw with."""


class Camera:
    """Draws shots as images, without a window; a context manager.

    Args:
        model: of the rod, left as it is.
        width, height: of an image, pixels, even; at most 1280 and 960.

    Raises:
        NoGraphics: there is no OpenGL, or not the kind that MUJOCO_GL names.
        ValueError: the image is larger.
    """

    def __init__(self, model: mujoco.MjModel, *, width: int = 640, height: int = 480) -> None:
        self._model = copy.copy(model)
        for name in ("line", "float"):  # _draw_line does it
            self._model.material(name).rgba[3] = 0.0
        _paint_water(self._model)
        self._data = mujoco.MjData(self._model)
        self._tip = self._model.site("tip").id
        self._line = [self._model.body(f"line_{k:02}").id for k in range(2, 31)]
        try:
            self._renderer = mujoco.Renderer(self._model, height, width)
        except (
            mujoco.FatalError,
            AttributeError,
            RuntimeError,
            ImportError,
        ) as error:  # each kind of OpenGL fails in its own way
            raise NoGraphics(no_graphics(error)) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def frame(self, shot: Shot, time: float) -> Frame:
        """The scene at ``time`` (s); from the landing on, the landing."""
        recording = shot.recording
        assert isinstance(recording, Recording)
        since, time = max(0.0, time - recording.landed), min(time, recording.landed)
        row = min(round(time / recording.step), len(recording.states) - 1)
        mujoco.mj_setState(self._model, self._data, recording.states[row], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, camera="shore")
        scene = self._renderer.scene
        _draw_plane(scene, shot)
        self._draw_line(scene, recording, time)
        if time == recording.landed:
            _draw_chain(scene, [np.append(shot.goal, 0.006), np.append(recording.outcome, 0.006)], 0.005, _GOAL)
            _draw_splash(scene, recording.outcome, since)
        return captioned(Image.fromarray(self._renderer.render()), shot.title, caption(shot, time))

    def _draw_line(self, scene: mujoco.MjvScene, recording: Recording, time: float) -> None:
        """The line, the float, and where the float has been."""
        here = recording.float_at(time)
        _draw_chain(scene, [*(recording.float_at(t) for t in np.arange(0.0, time, 0.02)), here], 0, _PATH)
        line = [self._data.site_xpos[self._tip], *self._data.xpos[self._line], here]
        if recording.let_out is not None and time > recording.let_out:
            line = [line[0], here]
        _draw_chain(scene, line, 0.003, _INK)
        _draw(scene, mujoco.mjtGeom.mjGEOM_SPHERE, (0.026, 0, 0), here, _FLOAT).emission = 0.4


def caption(shot: Shot, time: float) -> str:
    """The text below the picture at ``time`` (s)."""
    recording = shot.recording
    assert isinstance(recording, Recording)
    if time >= recording.landed:
        return f"goal {place(shot.goal)} m, landed {place(recording.outcome)} m: missed by {100 * shot.missed:.0f} cm"
    let_out = recording.let_out is not None and time > recording.let_out
    return f"goal {place(shot.goal)} m   {time:.2f} s{'   line let out' if let_out else ''}"


def no_graphics(error: Exception) -> str:
    """What to do when MuJoCo fails with ``error`` to find OpenGL."""
    asked = os.environ.get("MUJOCO_GL", "")
    return (
        f"MuJoCo finds no OpenGL to draw with (MUJOCO_GL={asked}: {error}); without a display set MUJOCO_GL=egl and "
        "install libegl1 (Debian, Ubuntu), or MUJOCO_GL=osmesa and libosmesa6"
    )


def _paint_water(model: mujoco.MjModel) -> None:
    """Ripples in place of the plain texture of the water: waves in all directions that meet at its edges."""
    texture = model.texture("water")
    height, width, channels = int(texture.height[0]), int(texture.width[0]), int(texture.nchannel[0])
    rng = stream(0, "water")
    y, x = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (height, width)), indexing="ij")
    surface = np.zeros((height, width))
    for along, across in rng.integers(-14, 15, (_WAVES, 2)):
        length = math.hypot(along, across)
        if length > 2:  # a longer wave would show that the texture repeats
            surface += np.sin(along * x + across * y + rng.uniform(0, 2 * np.pi)) / length
    shallow = 1 / (1 + np.exp(-1.2 * surface / surface.std()))
    colour = _DEEP + (_SHALLOW - _DEEP) * shallow[..., None]
    start = int(model.tex_adr[texture.id])
    model.tex_data[start : start + height * width * channels] = colour.astype(np.uint8).ravel()


def _draw_plane(scene: mujoco.MjvScene, shot: Shot) -> None:
    """On the water: the arm's stone, circles of half a metre and of a metre around it, past landings, the goal."""
    _draw(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, (0.11, 0.012, 0), np.array([0.0, 0.0, 0.012]), _STONE)
    for radius in (0.5, 1.0):
        _draw_chain(scene, _circle(np.zeros(2), radius), 0, _RING)
    for landing in shot.past[:: max(1, math.ceil(len(shot.past) / MOST_PAST))]:
        _draw(scene, mujoco.mjtGeom.mjGEOM_BOX, (0.007, 0.007, 0.001), np.append(landing, 0.001), _PAST)
    _draw_chain(scene, _circle(shot.goal, 0.06), 0.008, _GOAL)


def _draw_splash(scene: mujoco.MjvScene, landing: Array, since: float) -> None:
    """Two rings that grow from where the float has met the water ``since`` (s) ago, and fade."""
    for late in (0.0, 0.15):
        if 0 < since - late < 0.6:
            faded = (*_PAST[:3], 0.8 * (1 - (since - late) / 0.6))
            _draw_chain(scene, _circle(landing, 0.03 + 0.3 * (since - late)), 0, faded)


def _circle(centre: Array, radius: float) -> Array:
    angles = np.linspace(0, 2 * np.pi, 60)
    return np.append(centre, 0.004) + radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)


def _draw_chain(scene: mujoco.MjvScene, points: Sequence[Array] | Array, radius: float, colour: _Colour) -> None:
    """Rods from point to point, of a ``radius`` in m; 0 draws lines, which is quicker."""
    kind, width = (mujoco.mjtGeom.mjGEOM_CAPSULE, radius) if radius else (mujoco.mjtGeom.mjGEOM_LINE, 2)  # 2 pixels
    for start, stop in pairwise(points):
        mujoco.mjv_connector(_draw(scene, kind, (width, 0, 0), start, colour), kind, width, start, stop)


def _draw(scene: mujoco.MjvScene, kind: int, size: Sequence[float], place: Array, colour: _Colour) -> Any:
    """Add a body to the scene; ``size`` in m, as MuJoCo defines it for this ``kind``."""
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.array(size), place, np.eye(3).ravel(), np.array(colour, np.float32))
    scene.ngeom += 1
    return geom
