"""Calibration of the simulated camera like a real one: by OpenCV, from twenty images of a chessboard."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.camera.lens.distortion import Distortion
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from flyaround.simulator.recipes.plan import plan_recipe
from tools.craft.chessboard import COLUMNS, ROWS, SQUARE_M

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

BOARDS = 20  # number of images
LENSES: dict[str, Camera] = {
    "pinhole": Camera(width_px=800, height_px=600, fx_px=1015.0, fy_px=1023.0, cx_px=394.3, cy_px=305.8),
    "brown_conrady": Camera(
        width_px=800,
        height_px=600,
        fx_px=700.0,
        fy_px=705.0,
        cx_px=405.4,
        cy_px=295.6,
        distortion=Distortion("brown_conrady", (-0.28, 0.12, 0.0008, -0.0012, -0.03)),
    ),
    "kannala_brandt": Camera(
        width_px=800,
        height_px=600,
        fx_px=330.0,
        fy_px=332.0,
        cx_px=397.1,
        cy_px=303.2,
        distortion=Distortion("kannala_brandt", (0.04, -0.015, 0.006, -0.002)),
    ),
}


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration, and the true parameters.

    Parameters
    ----------
    lens : str
        Name of the lens in ``LENSES``.
    names : tuple of str
        Names of the K parameters.
    true : (K,) array
        True parameters.
    found : (K,) array
        Calibrated parameters.
    sigma : (K,) array
        Standard deviations that the calibration reports.
    rms_px : float
        Reprojection error.
    corners : int
        Number of corners used.
    """

    lens: str
    names: tuple[str, ...]
    true: FloatArray
    found: FloatArray
    sigma: FloatArray
    rms_px: float
    corners: int

    @property
    def deviation(self) -> FloatArray:
        """(K,) errors divided by sigma."""
        return (self.found - self.true) / self.sigma


def calibrate(renderer: Renderer, lens: str, *, boards: int = BOARDS, seed: int = 1) -> Calibration:
    """Render a chessboard in ``boards`` poses through a lens and calibrate the lens with OpenCV."""
    camera = LENSES[lens]
    corners_px = [corners(image) for image in pictures(renderer, camera, boards, seed)]
    views = [(points, pixels) for points, pixels in corners_px if len(points) >= 20]
    objects, pixels = [v[0] for v in views], [v[1] for v in views]
    solve = _fisheye if camera.distortion.model == "kannala_brandt" else _opencv
    names, values, sigma, rms = solve(camera, objects, pixels)
    true = [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, *camera.distortion.coefficients]
    true += [0.0] * (len(values) - len(true))
    return Calibration(lens, names, np.array(true), values, sigma, rms, sum(len(p) for p in pixels))


def pictures(renderer: Renderer, camera: Camera, count: int, seed: int) -> list[ByteArray]:
    """Return 8-bit images of the chessboard all over the field of view, with 0.7 px of blur and noise of 0.5 DN."""
    plan = replace(plan_recipe("calibration-chessboard", count, seed=seed, quality="high"), camera=camera)
    sensor = replace(sensor_preset("ideal"), blur_sigma_px=0.7, gaussian_variance=(0.5 / 255) ** 2)
    images = []
    for k in range(count):
        scene = replace(plan.scene(k), sensor=sensor)
        radiance = renderer.render(scene, plan.target).radiance
        images.append(np.asarray(digitise_scene(scene, expose_scene(scene, radiance)), np.uint8))
    return images


def corners(image: ByteArray) -> tuple[FloatArray, FloatArray]:
    """Return the object points (70, 3) and pixels (70, 2) of the chessboard's inner corners; none if not found."""
    is_detected, start = cv2.findChessboardCorners(image, (COLUMNS - 1, ROWS - 1))
    if not is_detected:
        return np.empty((0, 3)), np.empty((0, 2))
    rows, columns = np.divmod(np.arange((ROWS - 1) * (COLUMNS - 1)), COLUMNS - 1)
    points = np.stack([columns * SQUARE_M, rows * SQUARE_M, np.zeros(len(rows))], axis=1)
    # a window that stays inside the four squares around a corner
    spacing = _spacing_px(points, np.asarray(start, float).reshape(-1, 2))
    half = int(np.clip(0.4 * spacing, 3, 12))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-5)
    fine = cv2.cornerSubPix(image, start.copy(), (half, half), (-1, -1), criteria)
    return points, np.asarray(fine, float).reshape(-1, 2)


def _spacing_px(points: FloatArray, pixels: FloatArray) -> float:
    """Return the minimum image distance between corners that are neighbours on the board."""
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    step = distance[distance > 1e-9].min()
    a, b = np.nonzero((distance > 1e-9) & (distance < 1.01 * step))
    return float(np.linalg.norm(pixels[a] - pixels[b], axis=1).min())


def _opencv(
    camera: Camera, objects: list[FloatArray], pixels: list[FloatArray]
) -> tuple[tuple[str, ...], FloatArray, FloatArray, float]:
    size = (camera.width_px, camera.height_px)
    rms, K, d, _, _, sigma, _, _ = cv2.calibrateCameraExtended(
        [p.astype(np.float32)[:, None] for p in objects],
        [p.astype(np.float32)[:, None] for p in pixels],
        size,
        np.eye(3),
        np.zeros(5),
    )
    values = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *np.ravel(d)[:5]])
    names = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
    return names, values, np.asarray(np.ravel(sigma)[:9], float), float(rms)


def _fisheye(
    camera: Camera, objects: list[FloatArray], pixels: list[FloatArray]
) -> tuple[tuple[str, ...], FloatArray, FloatArray, float]:
    """Return OpenCV's fisheye calibration, with sigmas from the Jacobian at its solution, because it reports none."""
    # OpenCV 4 has these constants in its fisheye module, OpenCV 5 with the others
    home = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2
    flags = home.CALIB_RECOMPUTE_EXTRINSIC + home.CALIB_FIX_SKEW + home.CALIB_USE_INTRINSIC_GUESS
    # initial guess from the focal length of a data sheet
    middle = (camera.width_px - 1) / 2, (camera.height_px - 1) / 2
    guess = np.array([[0.95 * camera.fx_px, 0, middle[0]], [0, 0.95 * camera.fx_px, middle[1]], [0, 0, 1.0]])
    _, K, d, turns, moves = cv2.fisheye.calibrate(
        [p[None] for p in objects],
        [p[None] for p in pixels],
        (camera.width_px, camera.height_px),
        guess,
        np.zeros((4, 1)),
        flags=flags,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-10),
    )
    views = len(objects)
    rows, residuals = [], []
    for k, (points, pixels_) in enumerate(zip(objects, pixels, strict=True)):
        projected, J = cv2.fisheye.projectPoints(points[:, None], turns[k], moves[k], K, d)
        row = np.zeros((2 * len(points), 8 + 6 * views))
        row[:, :8] = J[:, :8]
        row[:, 8 + 6 * k : 14 + 6 * k] = J[:, 8:14]
        rows.append(row)
        residuals.append((projected.reshape(-1, 2) - pixels_).ravel())
    J, r = np.concatenate(rows), np.concatenate(residuals)
    variance = float(r @ r) / (len(r) - J.shape[1])
    sigma = np.sqrt(variance * np.diag(np.linalg.inv(J.T @ J))[:8])
    values = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *np.ravel(d)])
    rms = float(np.sqrt(2 * np.mean(r**2)))
    return ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "k4"), values, sigma, rms
