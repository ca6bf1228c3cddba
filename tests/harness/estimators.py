"""Estimators that estimate nothing, for boards in processes of their own: nothing is imported for them."""

from __future__ import annotations

import threading
import time
import zlib

PATIENCE_S = 60.0


class Estimate:
    """Accepts at once; a subclass of nothing, as a user's own would be."""

    accepted, reason, confidence = True, "", 1.0
    q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    t_camera_from_target_m = (0.0, 0.0, 1.0)

    def __init__(self) -> None:
        self.stages_ms: dict[str, float] = {}


class Instant:
    """Answers after the next of its ``sleeps``, at once when there is none left."""

    def __init__(self, _camera) -> None:
        self.sleeps: list[float] = []

    def estimate(self, _image):
        time.sleep(self.sleeps.pop(0) if self.sleeps else 0.0)
        return Estimate()


class Checksum:
    """Accepts, and says as a place what picture it saw: nothing wrong with its pixels goes unnoticed."""

    def __init__(self, _camera) -> None:
        pass

    def estimate(self, image):
        estimate = Estimate()
        estimate.t_camera_from_target_m = (float(zlib.crc32(image.tobytes()) % 1_000_000), 0.0, 1.0)
        return estimate


class Stuck:
    """Does not come back from pictures of level 7, and says the level as the range of others."""

    released = threading.Event()

    def __init__(self, _camera) -> None:
        pass

    def estimate(self, image):
        if image[0, 0] == 7:
            self.released.wait(PATIENCE_S)
        estimate = Estimate()
        estimate.t_camera_from_target_m = (0.0, 0.0, float(image[0, 0]))
        return estimate
