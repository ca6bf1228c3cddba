"""Compare a target's outline with a photograph of the craft: ``python -m tools.validation.outline PICTURE --side=+x``.

Pose and focal length are fitted to the photograph's outline; the residual is the model's error: intersection over union
of the two filled outlines, and the distance between them. The photograph's outline comes from a JSON file of polygons
traced by hand (``--outline``), or from its brightness in front of a black sky.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray
    from flyaround.simulator.targets.model import Target

SIDES = {
    "+x": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    "-x": ((0, -1, 0), (0, 0, -1), (1, 0, 0)),
    "+y": ((-1, 0, 0), (0, 0, -1), (0, -1, 0)),
    "-y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "+z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "-z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
}
"""Initial camera axes (right, down, forward) in the target frame: upright as in Tango's public images."""
TILTS_RAD = tuple(itertools.product((-0.06, 0.0, 0.06), repeat=2))  # initial tilts
START_RANGES = (6.0,)
"""Initial ranges in widths of the craft."""
STEP = np.array([0.015, 0.015, 0.005, 0.003, 0.003, 0.05, 0.005])
"""Steps of the derivatives: rotations [rad], shifts in widths of the craft, log range at constant size, log size."""
ROBUST_PX = (12.0, 4.0, 1.5)
"""Distances beyond which a point has little weight, decreasing, so that missing parts do not bias the fit."""
POINTS = 500  # points of the outline in a fit
POLISH = 200
"""Evaluations of the overlap in the final optimisation."""
FILL_SHIFT = 4  # fractional bits of OpenCV's polygon coordinates
BLUR_PX = 1.2  # blur of the photograph before thresholding
MIN_AREA_PX = 40
"""Minimum area of a bright region that counts as craft in front of a black sky, after the blur."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Overlap [1], median and 95th percentile of the distance between outlines [px], pose and focal length [px]."""

    overlap: float
    median_px: float
    p95_px: float
    R_camera_from_target: FloatArray
    t_camera_from_target_m: FloatArray
    focal_px: float
    reference: ByteArray
    model: ByteArray


@dataclass(frozen=True, eq=False)
class _Mesh:
    positions_m: FloatArray
    triangles: FloatArray


def fit_outline(reference: ByteArray, target: Target, side: str, coarse: Target | None = None) -> Fit:
    """Fit pose and focal length of a pinhole camera with central principal point, and measure the residual.

    Parameters
    ----------
    reference : ByteArray
        (H, W) filled outline of the craft, nonzero inside.
    target : Target
        Model of the craft.
    side : str
        Axis from which the camera initially looks.
    coarse : Target, optional
        Model with fewer triangles for the fit.

    Raises
    ------
    UserError
        If the outline is empty.
    """
    reference = filled(np.asarray(reference > 0, np.uint8))
    if not reference.any():
        raise UserError("the picture's outline is empty: trace it (--outline) or lower --threshold")
    mesh, first = _mesh(target), _mesh(coarse or target)
    wide, middle, narrow = ROBUST_PX
    starts = [
        _start(reference, first, side, start_range) + np.r_[tilt, np.zeros(5)]
        for start_range in START_RANGES
        for tilt in TILTS_RAD
    ]
    tried = [_descend(reference, first, side, x, 7, 4, wide) for x in starts]
    tried = sorted(tried, key=lambda x: _lost(reference, first, side, x, 4))[:4]
    tried = [_descend(reference, first, side, x, 10, 2, middle) for x in tried]
    x = min(tried, key=lambda x: _lost(reference, first, side, x, 2))
    x = _descend(reference, first, side, x, 8, 1, narrow)
    simplex = np.vstack([x, x + np.diag(STEP)])
    solution = minimize(
        functools.partial(_lost_at, reference, first, side),
        x,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": POLISH},
    )
    x = np.asarray(solution.x)
    model = _drawn(reference.shape, mesh, side, x, 1)
    R, t_m, focal = _pose(mesh, side, x)
    residual = np.abs(_distances(reference, mesh, side, x, 1))
    return Fit(
        overlap=float((reference & model).sum() / (reference | model).sum()),
        median_px=float(np.median(residual)),
        p95_px=float(np.percentile(residual, 95)),
        R_camera_from_target=R,
        t_camera_from_target_m=t_m,
        focal_px=focal,
        reference=reference,
        model=model,
    )


def filled(mask: ByteArray) -> ByteArray:
    """Return the mask without holes, because a hand-traced outline is the outer one."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    out = np.zeros_like(mask)
    cv2.drawContours(out, outlines, -1, 1, cv2.FILLED)
    return out


def _mesh(target: Target) -> _Mesh:
    offsets = np.cumsum([0, *(len(p.positions_m) for p in target.parts)])
    return _Mesh(
        np.concatenate([p.positions_m for p in target.parts]).astype(float),
        np.concatenate([p.triangles + o for p, o in zip(target.parts, offsets[:-1], strict=True)]),
    )


def _width_m(mesh: _Mesh) -> float:
    return float(np.ptp(mesh.positions_m, axis=0).max())


def _start(reference: ByteArray, mesh: _Mesh, side: str, range_widths: float) -> FloatArray:
    """Return initial parameters: view along the side's axis, at the outline's size and position."""
    projected = mesh.positions_m @ np.array(SIDES[side], float).T / _width_m(mesh)
    middle = (projected.min(axis=0) + projected.max(axis=0)) / 2
    v, u = np.nonzero(reference)
    scale_px = float(np.ptp(u) / np.ptp(projected[:, 0]))
    h, w = reference.shape
    centre = (np.array([u.min() + u.max(), v.min() + v.max()]) - (w - 1, h - 1)) / 2 / scale_px
    return np.r_[0, 0, 0, centre - middle[:2], np.log(range_widths), np.log(scale_px)]


def _pose(mesh: _Mesh, side: str, x: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return rotation, translation [m] and focal length [px] of the parameters; x[6] is the log of the image size."""
    R = Rotation.from_rotvec(x[:3]).as_matrix() @ np.array(SIDES[side], float)
    return R, np.array([x[3], x[4], np.exp(x[5])]) * _width_m(mesh), float(np.exp(x[5] + x[6]))


def _drawn(shape: tuple[int, ...], mesh: _Mesh, side: str, x: FloatArray, shrink: int) -> ByteArray:
    """Return the model's filled outline on an image ``shrink`` times smaller."""
    R, t_m, focal = _pose(mesh, side, x)
    in_camera = mesh.positions_m @ R.T + t_m
    middle = (np.array(shape[::-1]) - 1) / 2
    uv = (in_camera[:, :2] / np.maximum(in_camera[:, 2:], 1e-3) * focal + middle + 0.5) / shrink - 0.5
    image = np.zeros((shape[0] // shrink, shape[1] // shrink), np.uint8)
    corners = np.rint(np.clip(uv, -1e4, 1e4) * 2**FILL_SHIFT).astype(np.int32)[mesh.triangles]
    # the front-facing triangles cover the silhouette
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    for triangle in corners[a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]]:
        cv2.fillConvexPoly(image, triangle, 1, cv2.LINE_8, FILL_SHIFT)
    return filled(image)


def _distances(reference: ByteArray, mesh: _Mesh, side: str, x: FloatArray, shrink: int) -> FloatArray:
    """Return the distances of the reference's outline points to the model's outline [image px], positive inside."""
    outlines, _ = cv2.findContours(reference, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    points = np.concatenate([o[:, 0] for o in outlines]).astype(float)
    points = points[np.linspace(0, len(points) - 1, POINTS).astype(int)]
    model = _drawn(reference.shape, mesh, side, x, shrink)
    signed = cv2.distanceTransform(model, cv2.DIST_L2, 5) - cv2.distanceTransform(1 - model, cv2.DIST_L2, 5)
    positions = ((points + 0.5) / shrink - 0.5).astype(np.float32)
    signed = np.where(signed > 0, signed - 0.5, signed + 0.5).astype(np.float32)
    values = cv2.remap(
        signed,
        positions[None, :, 0],
        positions[None, :, 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )[0]
    # the reference's contour passes through the centres of its outermost pixels, half a pixel inside
    return np.asarray(values.astype(float) * shrink - 0.5)


def _lost(reference: ByteArray, mesh: _Mesh, side: str, x: FloatArray, shrink: int) -> float:
    """Return one minus the overlap, on an image ``shrink`` times smaller."""
    model = _drawn(reference.shape, mesh, side, x, shrink)
    small = cv2.resize(255 * reference, model.shape[::-1], interpolation=cv2.INTER_AREA) > 127
    return 1 - float((small & (model > 0)).sum() / max((small | (model > 0)).sum(), 1))


def _lost_at(reference: ByteArray, mesh: _Mesh, side: str, x: FloatArray) -> float:
    return _lost(reference, mesh, side, x, 1)


def _misfit(r: FloatArray, robust_px: float) -> float:
    return float(np.log1p((r / robust_px) ** 2).sum())


def _descend(
    reference: ByteArray, mesh: _Mesh, side: str, x: FloatArray, steps: int, shrink: int, robust_px: float
) -> FloatArray:
    """Minimise the distances by Gauss-Newton with Cauchy weights, which suppress missing parts of the model."""
    damping = 1e-2
    r = _distances(reference, mesh, side, x, shrink)
    for _ in range(steps):
        forward = [_distances(reference, mesh, side, x + d, shrink) for d in np.diag(STEP)]
        backward = [_distances(reference, mesh, side, x - d, shrink) for d in np.diag(STEP)]
        J = (np.array(forward) - np.array(backward)).T / 2
        w = 1 / (1 + (r / robust_px) ** 2)
        A = J.T @ (J * w[:, None])
        y = np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-6), -J.T @ (w * r))
        new = x + y * STEP
        after = _distances(reference, mesh, side, new, shrink)
        if _misfit(after, robust_px) < _misfit(r, robust_px):
            x, r, damping = new, after, damping / 3
        else:
            damping *= 6
    return x


def read_picture(path: Path, outline: Path | None, threshold_dn: float) -> tuple[ByteArray, ByteArray]:
    """Return an image (H, W) and its craft's filled outline.

    Raises
    ------
    UserError
        If a file cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise UserError(f"cannot read picture {path}: give a JPEG or PNG file")
    grey = np.asarray(image, np.uint8)
    mask = np.zeros_like(grey)
    if outline is None:
        _, bright = cv2.threshold(cv2.GaussianBlur(grey, (0, 0), BLUR_PX), threshold_dn, 1, cv2.THRESH_BINARY)
        contours, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        pieces = [c for c in contours if cv2.contourArea(c) >= MIN_AREA_PX]
        cv2.drawContours(mask, pieces, -1, 1, cv2.FILLED)
        return grey, np.asarray(mask, np.uint8)
    try:
        polygons = [np.array(p, float).reshape(-1, 2) for p in json.loads(outline.read_text())]
    except (OSError, ValueError, TypeError) as error:
        raise UserError(
            f"cannot read outline {outline}: give a JSON list of polygons [[[x, y], ...], ...] in pixels"
        ) from error
    for polygon in polygons:
        cv2.fillPoly(mask, [np.rint(polygon).astype(np.int32)], 1)
    return grey, np.asarray(mask, np.uint8)


def overlay(image: ByteArray, fit: Fit) -> ByteArray:
    """Return the image (BGR) with its own outline in yellow and the model's in red."""
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    for mask, colour in ((fit.reference, (0, 255, 255)), (fit.model, (0, 0, 255))):
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(canvas, contours, -1, colour, 1)
    return np.asarray(canvas, np.uint8)


def main(argv: list[str] | None = None) -> int:
    """Fit one image, print the result and write the overlay; return 2 for a user error."""
    parser = argparse.ArgumentParser(prog="python -m tools.validation.outline", description=__doc__)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--side", choices=SIDES, default="+z", help="axis from which the camera looks")
    parser.add_argument("--target", default="tango")
    parser.add_argument("--outline", type=Path, help="JSON list of polygons in pixels, traced by hand")
    parser.add_argument("--threshold", type=float, default=30.0, help="minimum brightness of the craft [DN]")
    parser.add_argument("-o", "--overlay", type=Path, help="image with both outlines")
    options = parser.parse_args(argv)
    try:
        image, reference = read_picture(options.picture, options.outline, options.threshold)
        fit = fit_outline(
            reference, load_target(options.target), options.side, load_target(options.target, "low")
        )
    except UserError as error:
        sys.stdout.write(f"{error}\n")
        return 2
    sys.stdout.write(
        f"{options.picture.name}: overlap {fit.overlap:.3f}, outlines {fit.median_px:.2f} px apart (median), "
        f"{fit.p95_px:.1f} px (95th percentile); focal length {fit.focal_px:.0f} px, "
        f"range {fit.t_camera_from_target_m[2]:.2f} m\n"
    )
    if options.overlay:
        cv2.imwrite(str(options.overlay), overlay(image, fit))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
