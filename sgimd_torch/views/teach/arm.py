"""The arm on the page: one viewer at a time leads it, and records that.

arm = LedArm(led); arm.grab(viewer, "hand", point); arm.drag(viewer, point); arm.leading.step(seconds)
"""

from __future__ import annotations

from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import LedMovement
from sgimd_torch.environments.protocol import HandLed
from sgimd_torch.spaces import Array

NOBODY = -1


class LedArm:
    """An arm that one viewer at a time holds. The others wait until they let go; all may do all else.

    Args:
        led: the robot.

    Attributes:
        leading: follows the hand.
        recorder: the viewer who records, `NOBODY` if nobody does.

    Raises:
        ValueError: see `Leading`.
    """

    def __init__(self, led: HandLed) -> None:
        self.leading = Leading(led)
        self.recorder = NOBODY
        self._hand, self._holder = led.hand, NOBODY
        self._offset = self.leading.point - self.leading.point  # (3,) m from the mouse to the held point

    def grab(self, viewer: int, body: str, point: Array) -> None:
        """Take hold of a ``body`` where the mouse touches it, ``(3,)`` m, unless another viewer holds it.

        Raises:
            ValueError: it cannot be led.
        """
        if not self.leading.held:
            self._holder = viewer
            self.leading.grab(body, None if body == self._hand else point)
            self._offset = self.leading.point - point

    def drag(self, viewer: int, point: Array) -> None:
        """The mouse goes to ``point`` ``(3,)`` m."""
        if self.leading.held and viewer == self._holder:
            self.leading.drag(point + self._offset)

    def let_go(self, viewer: int) -> None:
        """This viewer does not hold it any more."""
        if viewer == self._holder:
            self.leading.release()

    def record(self, viewer: int) -> None:
        """Begin a recording."""
        self.leading.record()
        self.recorder = viewer

    def stop(self) -> LedMovement:
        """End the recording; what was led, without the stillness before and after it.

        Raises:
            ValueError: the arm was not moved; the recording is over all the same.
        """
        self.recorder = NOBODY
        return self.leading.stop().moving()
