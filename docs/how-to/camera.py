"""A camera above the table sees a puck by ArUco markers: four that lie still, and one on the puck.

sgimd run --environment lerobot --environment.outcome body:puck:xy --environment.seen_by camera:puck ...
OpenCV draws markers: cv2.aruco.generateImageMarker(DICTIONARY, 4, 400). The still ones may lie anywhere, not in line.
"""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
TABLE = {0: (0.0, -0.3), 1: (0.5, -0.3), 2: (0.5, 0.3), 3: (0.0, 0.3)}  # m, where the middle of each marker lies
PUCK = 4  # number of the marker on the puck
CAMERA = "above"  # name of the camera in the observations of the robot
detector = cv2.aruco.ArucoDetector(DICTIONARY)


def puck(observation: Mapping[str, Any]) -> np.ndarray:
    """``(2,)`` m, place of the middle of the puck's marker on the table."""
    corners, numbers, _ = detector.detectMarkers(observation[CAMERA])
    seen = {} if numbers is None else dict(zip(numbers.ravel().tolist(), corners, strict=True))
    if hidden := [number for number in (*TABLE, PUCK) if number not in seen]:
        raise LookupError(f"the markers {hidden} are not seen")
    middles = {number: _middle(square.reshape(4, 2)) for number, square in seen.items()}
    to_table, _ = cv2.findHomography(np.array([middles[number] for number in TABLE]), np.array([*TABLE.values()]))
    return cv2.perspectiveTransform(middles[PUCK].reshape(1, 1, 2), to_table).reshape(2)


def _middle(square: np.ndarray) -> np.ndarray:
    """``(2,)``, where the diagonals of a square ``(4, 2)`` cross in the picture, as they do on the table."""
    a, b, c, d = square.astype(np.float64)
    share = np.linalg.solve(np.stack([c - a, b - d], axis=1), b - a)[0]
    return a + share * (c - a)
