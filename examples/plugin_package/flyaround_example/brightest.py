"""An estimator that takes everything bright for the target, two metres away, and never accepts its own answer."""

from dataclasses import dataclass, field

import numpy as np

from flyaround.plugins import BoardModel, CameraIntrinsics, Estimate


@dataclass
class Answer:
    """An `Estimate`."""

    t_camera_from_target_m: np.ndarray
    accepted: bool = False
    reason: str = "a guess"
    q_camera_from_target_wxyz: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    confidence: float = 0.0
    stages_ms: dict[str, float] = field(default_factory=dict)


class Brightest:
    """Created once for a target and a camera, then called image by image."""

    def __init__(self, model: BoardModel, camera: CameraIntrinsics) -> None:
        # the model holds the target's wireframe, keypoints and more
        self._model, self._camera = model, camera

    def estimate(self, image: np.ndarray) -> Estimate:
        """Return the pose in an (H, W) image."""
        y, x = np.nonzero(image >= 0.5 * image.max())
        c = self._camera
        ray = np.array([(x.mean() - c.cx_px) / c.fx_px, (y.mean() - c.cy_px) / c.fy_px, 1.0])
        return Answer(2.0 * ray)
