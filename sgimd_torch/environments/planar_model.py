"""A planar arm as a MuJoCo model, so that a person can lead it by the hand and view it like other robots.

The arm lies in the plane z = 0; at zero angles all links point along +x. The model has geometry but no physics.
    model = planar_model([0.5, 0.3, 0.2]); model.joint("joint_1"); model.site("end")
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import mujoco

JOINT: Final = "joint_{}"
LINK: Final = "link_{}"


def planar_model(lengths: Sequence[float]) -> mujoco.MjModel:
    """An arm of hinges, each followed by a link of the next of ``lengths`` (m); its end is the site "end"."""
    spec = mujoco.MjSpec()
    body, at, thickness = spec.worldbody, 0.0, 0.02 * sum(lengths)
    for number, length in enumerate(lengths):
        body = body.add_body(name=LINK.format(number), pos=[at, 0, 0])
        body.add_joint(name=JOINT.format(number), type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        body.add_geom(
            name=LINK.format(number),
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0, 0, 0, length, 0, 0],
            size=[thickness, 0, 0],
            contype=0,
            conaffinity=0,
        )
        at = length
    body.add_site(name="end", pos=[at, 0, 0], size=[thickness, 0, 0])
    return spec.compile()
