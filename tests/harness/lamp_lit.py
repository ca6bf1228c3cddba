"""A frame of a craft as the board itself draws it, under one lamp and with noise."""

from __future__ import annotations

import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.decide.confidence import Evidence
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_formation import blurred
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces

FINE, SIGMA = 3, 3.0
CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
SUN = np.array([0.3, -0.2, -0.93])
Q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))
T_M = np.array([0.05, -0.05, 4.2])

# What is seen of a mock-up at the right pose.
MOCK_UP = Evidence(
    drawn=0.5,
    explained=0.65,
    outside=0.0,
    margin=0.1,
    matched_share=0.5,
    tight=0.5,
    rms_px=0.0,
    sigma_rad=0.004,
    sigma_share=0.002,
    edges=300,
    size_px=500.0,
    empty=True,
    score=0.23,
    likeness=0.97,
    covered=0.2,
)


def lamp_lit(
    craft: PreparedTarget,
    camera: CameraIntrinsics,
    q: np.ndarray,
    t: np.ndarray,
    to_lamp: np.ndarray,
    *,
    sigma: float = SIGMA,
    pedestal: float = 0.0,
) -> Observation:
    """The craft at a pose before empty space, each material of a shade of its own."""
    faces, R, (h, w) = faces_of(craft), quat.matrix(q), (camera.height_px, camera.width_px)
    plain = ImagePatch(np.zeros((h, w), np.float32), 2.0, 0.0, 0.0, 1.0, FINE)
    seen = draw_faces(faces, order_faces(faces, -R.T @ t), camera, R, t, plain)
    lit = np.array([60.0, 200.0, 140.0])[faces.material % 3] * np.clip(
        faces.normals @ (R.T @ to_lamp), 0.1, 1
    )
    drawn = np.concatenate([[0.0], lit])[seen].astype(np.float32)
    small = blurred(drawn.reshape(h, FINE, w, FINE).mean(axis=(1, 3)), 1.0)
    noisy = small + pedestal + np.random.default_rng(3).normal(0, sigma, small.shape)
    frame = Observation(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    frame.noise, frame.background = sigma, pedestal
    return frame
