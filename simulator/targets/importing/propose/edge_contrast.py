"""Contrast of edges, measured in small images that are shaded on the CPU from many directions.

A crease of the model may be invisible in images: it may be finer than a pixel, its faces may be equally bright, or
another body may hide it. So the brightness step across each candidate edge is measured in all views that show it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.geometry.directions import sphere_directions
from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
from flyaround.simulator.targets.importing.propose.surface_points import SurfacePoints, surface_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Material

VIEWS = sphere_directions(40)
SIZE_PX = 256  # side of a view's image; finer ones need more surface points to have none of them missing
POINTS = 450_000  # surface points that are projected; more leave fewer pixels without one
SAMPLE_OFFSET_PX = 2.5
"""Distance from the edge at which brightness is sampled [px], similar to that of an estimator on a small craft."""
SURFACE_TOLERANCE = 0.012
"""Distance behind the drawn surface up to which a point of an edge counts as visible, relative to the craft's size."""
LIGHTS = ((0.0, 0.0), (50.0, 30.0), (50.0, 150.0), (50.0, 270.0))
"""Directions of the Sun [deg], one frontal and three from the side: angle from the line of sight, azimuth around it."""
PLACES = (0.2, 0.5, 0.8)  # places along an edge that are compared, away from the corners at its ends
MIN_LENGTH = (
    0.02  # projected length, in radii of the craft, below which an edge is seen end-on and has no sides
)
FILLED_SHARE = (
    0.94  # share of the image that the craft's sphere spans: the margin is larger than SAMPLE_OFFSET_PX
)
MIN_FULL_NEIGHBOURS = 5  # of eight, around an empty cell that is a gap and not beyond the outline
AMBIENT = 0.02  # light in the shade, relative to the Sun's


def edge_contrast(
    bodies: list[MeshBody],
    materials: Sequence[Material],
    a_m: FloatArray,
    b_m: FloatArray,
    depth_m: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Measure the contrast and visibility of line segments over all views.

    Parameters
    ----------
    bodies : list of MeshBody
        Meshes of the craft.
    materials : sequence of Material
        Materials of the bodies.
    a_m : (K, 3) array
        First end of each edge [m].
    b_m : (K, 3) array
        Second end of each edge [m].
    depth_m : (K,) array
        Depth of each segment below the surface, for example of a rod's axis.

    Returns
    -------
    contrast : (K,) array
        Mean brightness step across the segment where it is visible, relative to the craft's brightest surface, 0..1.
    visibility : (K,) array
        Unoccluded fraction of views and of points along the segment.
    """
    surface = surface_points(bodies, POINTS)
    albedo = np.array([float(np.mean(m.base_color)) for m in materials])[surface.material]
    low, high = surface.points_m.min(axis=0), surface.points_m.max(axis=0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    points = np.stack([a_m + s * (b_m - a_m) for s in PLACES], axis=1) - center
    contrast, visibility = np.zeros(points.shape[:2]), np.zeros(points.shape[:2])
    for view_direction in VIEWS:
        axes = _axes(view_direction)
        depth, light = _picture(surface, albedo, center, radius, axes)
        view_points = points @ axes.T
        xy = _pixels(view_points[..., :2], radius)
        direction = np.stack([(b_m - a_m) @ axes[0], (b_m - a_m) @ axes[1]], axis=1)
        length = np.linalg.norm(direction, axis=1)
        normal_px = np.stack([-direction[:, 1], direction[:, 0]], axis=1) / np.maximum(length[:, None], 1e-12)
        row, column = np.rint(xy).astype(int)[..., 1], np.rint(xy).astype(int)[..., 0]
        visible = (
            view_points[..., 2] >= depth[row, column] - SURFACE_TOLERANCE * 2 * radius - depth_m[:, None]
        ) & (length > MIN_LENGTH * radius)[:, None]
        sides = []
        for sign in (-1.0, 1.0):
            sides_px = np.rint(xy + sign * SAMPLE_OFFSET_PX * normal_px[:, None]).astype(int)
            sides.append(light[:, sides_px[..., 1], sides_px[..., 0]])
        # mean over the directions of the Sun
        mean_step = np.abs(sides[0] - sides[1]).mean(axis=0)
        contrast += np.where(visible, mean_step, 0.0)
        visibility += visible
    return (contrast.sum(axis=1) / np.maximum(visibility.sum(axis=1), 1)), visibility.mean(axis=1) / len(
        VIEWS
    )


def _axes(direction: FloatArray) -> FloatArray:
    """Return the (3, 3) rows: right, up, and towards the camera."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(direction, x), direction])


def _pixels(xy: FloatArray | Float32Array, radius: float) -> FloatArray:
    """Return positions in the image, with a margin for the comparison."""
    return np.asarray((xy / radius * FILLED_SHARE + 1) * (SIZE_PX - 1) / 2)


def _picture(
    surface: SurfacePoints, albedo: FloatArray, center: FloatArray, radius: float, axes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the nearest surface to the camera (H, W), -inf outside, and its brightness under each light (L, H, W)."""
    # single precision suffices for positions in a small image
    cells = (surface.points_m - center).astype(np.float32) @ axes.T.astype(np.float32)
    x, y = np.rint(_pixels(cells[:, :2], radius)).astype(np.int32).T
    cell = y * SIZE_PX + x
    height = cells[:, 2].astype(float)
    nearest = np.full(SIZE_PX * SIZE_PX, -np.inf)
    np.maximum.at(nearest, cell, height)
    depth = nearest.reshape(SIZE_PX, SIZE_PX)
    # cells without a point take the value of their neighbours
    filled = _close_gaps(depth)
    winner = np.full(SIZE_PX * SIZE_PX, -1, np.int64)
    front = height >= nearest[cell]
    index = np.flatnonzero(front)
    winner[cell[index]] = index
    winner = _copy_to_neighbours(winner.reshape(SIZE_PX, SIZE_PX), np.isfinite(filled))
    normal = surface.normals[winner] @ axes.T
    brightness = []
    for elevation, azimuth in np.deg2rad(LIGHTS):
        sun = np.array(
            [np.sin(elevation) * np.cos(azimuth), np.sin(elevation) * np.sin(azimuth), np.cos(elevation)]
        )
        shaded = albedo[winner] * (np.maximum(normal @ sun, 0.0) + AMBIENT)
        # single points are noisy: average 3 x 3
        brightness.append(cv2.blur(np.where(winner >= 0, shaded, 0.0), (3, 3)))
    # the background is black, so the contrast of outlines equals the surface's brightness
    return filled, np.asarray(brightness, float) / max(float(albedo.max()), 1e-6)


def _close_gaps(depth: FloatArray) -> FloatArray:
    """Fill empty cells that have at least five full neighbours with the nearest of them."""
    padded = np.pad(depth, 1, constant_values=-np.inf)
    neighbours = np.stack(
        [padded[1 + i : 1 + i + SIZE_PX, 1 + j : 1 + j + SIZE_PX] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    )
    n_filled = np.isfinite(neighbours).sum(axis=0)
    return np.where(np.isfinite(depth) | (n_filled < MIN_FULL_NEIGHBOURS), depth, neighbours.max(axis=0))


def _copy_to_neighbours(winner: np.ndarray, filled: np.ndarray) -> np.ndarray:
    """Assign filled cells without a point of their own to a neighbour's point."""
    owner = winner.copy()
    padded = np.pad(winner, 1, constant_values=-1)
    for i, j in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1)):
        neighbour = padded[1 + i : 1 + i + SIZE_PX, 1 + j : 1 + j + SIZE_PX]
        owner = np.where((owner < 0) & filled, neighbour, owner)
    return owner
