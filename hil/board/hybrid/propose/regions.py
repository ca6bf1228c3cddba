"""Regions of interest that may contain the target."""

from __future__ import annotations

from typing import List, Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.hybrid.image.edge_field import gradient, gradient_noise, thin_edges
from flyaround.hil.board.hybrid.propose.saliency import (
    CELL_PX,
    boxes,
    saliency_map,
    shipped_weights,
    straight_segments,
)
from flyaround.hil.board.svd.line_streams import remove_specks
from flyaround.hil.board.svd.region_of_interest import Box, Region, cdf_box, overlap
from flyaround.hil.board.svd.weak_gradients import WeakGradientElimination

Array = np.ndarray

# Reduction of the searched image: averaging 16 pixels divides the noise by four.
REDUCTION = 4

# Largest number of windows.
MAX_WINDOWS = 6

# Shortest segment that counts for a window [px of the reduced image].
MIN_SEGMENT_PX = 8.0

# Edges closer than this form one group [px of the reduced image]; hand-tuned. Groups are proposed at three scales.
JOIN_PX = 31
JOIN_SCALES_PX = (13, JOIN_PX, 7)

# Shortest side of a region [px of the reduced image], least number of edges of a part that is merged with the main one,
# and of edges in the image for which their share outside the main group is taken; hand-tuned.
MIN_SIDE_PX, MIN_PART_EDGES, MIN_EDGES = 3, 4, 200

# Side of a tile [px of the reduced image], and its least number of edges: two may be noise.
TILE_PX, MIN_TILE_EDGES = 16, 3

# Share of the edges on the target above which the background is empty space and the target fills the frame; hand-tuned.
MIN_CRAFT_SHARE = 0.8

# Intersection over union above which two regions are one; largest gap between parts of one craft, over the main part's
# diagonal; share of tiles with edges from which the background is textured. Chosen by eye.
SAME_REGION, MAX_GAP, BUSY_SHARE = 0.85, 0.6, 0.2


def clusters(mask: Array, join_px: int) -> List[Tuple[int, int, int, int, int]]:
    """Return boxes (x0, y0, x1, y1, edge pixels) of the groups of edges closer than ``join_px``, largest first."""
    size = 2 * (join_px // 2) + 1
    rows, columns = (np.flatnonzero(mask.any(axis=k)).tolist() for k in (1, 0))
    if not rows:
        return []
    # crop to the extent of the edges
    y0, x0 = rows[0], columns[0]
    part = mask[y0 : rows[-1] + 1, x0 : columns[-1] + 1]
    joined = cv2.dilate(part.view(np.uint8), np.ones((size, size), np.uint8))
    pixel = np.flatnonzero(part)
    label = cv2.connectedComponents(joined, connectivity=8)[1].ravel().take(pixel)
    # sort by group, then by row
    pixel = pixel.take(np.argsort(label, kind="stable"))
    count = np.bincount(label)
    count = count[count > 0]
    last = np.cumsum(count) - 1
    first = last - count + 1
    y, x = np.divmod(pixel, part.shape[1])
    left, right = np.minimum.reduceat(x, first) + x0, np.maximum.reduceat(x, first) + x0
    bounds = np.stack([left, y[first] + y0, right, y[last] + y0, count], axis=-1)
    return sorted(map(tuple, bounds.tolist()), key=lambda c: -c[4])


def propose_regions(
    small: Array, wge: WeakGradientElimination, noise_small: float
) -> Tuple[List[Region], float, Optional[Array]]:
    """Return the regions of an image that may contain the target.

    In front of black space everything above the noise belongs to the target, so the box of the edge cluster is the best
    region. In front of the Earth that box grows to nearly the whole frame; there, regions come from the saliency
    network and from dense groups of straight segments.

    Parameters
    ----------
    small : (h, w) array
        The image reduced by ``REDUCTION``, float32.
    wge : WeakGradientElimination
        Strong gradients of the reduced image.
    noise_small : float
        Standard deviation of the reduced image's noise.

    Returns
    -------
    regions : list of Region
        Regions, most likely first.
    busy : float
        Share of the frame that is not empty space.
    craft_probability : (h', w') array, optional
        Probability that a cell shows the target; None in front of empty space.
    """
    gx, gy = gradient(small, 1.0)
    sigma = max(noise_small * gradient_noise(1.0), 1e-6)
    mask = remove_specks(thin_edges(gx, gy, sigma), 4)
    regions: List[Region] = []
    craft_probability: Optional[Array] = None
    grouped = {join: clusters(mask, join) for join in JOIN_SCALES_PX}
    busy = max(float(_busy_share(mask)), _share_outside(grouped[JOIN_PX], int(mask.sum())))

    def add(x0: float, y0: float, x1: float, y1: float, source: str) -> None:
        f = REDUCTION
        r = Region(x0 * f, y0 * f, (x1 + 1) * f - 1, (y1 + 1) * f - 1, source)
        if min(x1 - x0, y1 - y0) < MIN_SIDE_PX or any(overlap(r[:4], o[:4]) > SAME_REGION for o in regions):
            return
        regions.append(r)

    for join, groups in grouped.items():
        if not groups:
            continue
        x0, y0, x1, y1, _ = groups[0]
        add(x0, y0, x1, y1, f"cluster-{join}")
        # lit parts may be separate: merge all large groups near the main one
        diagonal = np.hypot(x1 - x0, y1 - y0)
        for g in groups[1:]:
            gap = max(g[0] - x1, x0 - g[2], g[1] - y1, y0 - g[3], 0)
            if gap < MAX_GAP * diagonal and g[4] >= MIN_PART_EDGES:
                x0, y0, x1, y1 = min(x0, g[0]), min(y0, g[1]), max(x1, g[2]), max(y1, g[3])
        if busy < BUSY_SHARE:
            add(x0, y0, x1, y1, f"clusters-{join}")
    if busy >= BUSY_SHARE:
        # in front of a texture: artificial objects have many straight lines close together
        segments = straight_segments(small)
        weights = shipped_weights()
        if weights is not None:
            craft_probability = saliency_map(small, noise_small, weights, segments, (gx, gy))
            if _craft_share(mask, craft_probability) > MIN_CRAFT_SHARE:
                # a near target fills the frame with its own edges
                return regions, 0.0, None
            for box in boxes(craft_probability, 2):
                add(CELL_PX * box[0], CELL_PX * box[1], CELL_PX * box[2], CELL_PX * box[3], "saliency")
        for box in straight_windows(small, segments):
            add(*box, "straight")
        regions.sort(
            key=lambda r: (
                ("saliency", "straight").index(r.source) if r.source in ("saliency", "straight") else 2
            )
        )
    cdf = cdf_box(wge.strong, REDUCTION)
    if not any(overlap(cdf[:4], o[:4]) > SAME_REGION for o in regions):
        regions.append(cdf)
    return regions, busy, craft_probability


def straight_windows(small: Array, segments: Array) -> List[Box]:
    """Return boxes around the densest groups of long straight segments (N, 4), best first [px of ``small``].

    A segment counts by its squared length, because coastlines and clouds break into short pieces.
    """
    segments = segments[np.hypot(*(segments[:, 2:] - segments[:, :2]).T) >= MIN_SEGMENT_PX]
    if not len(segments):
        return []
    h, w = small.shape
    ends = segments.reshape(-1, 2, 2)
    middle = ends.mean(axis=1)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # clamp the length: the Earth's limb is one very long line that would outweigh all edges of the target
    weight = np.minimum(length, 60.0) ** 2
    d = (ends[:, 1] - ends[:, 0]) / length[:, None]
    # a resolution of two pixels suffices for windows
    h, w = (h + 1) // 2, (w + 1) // 2
    x, y = np.clip((0.5 * middle + 0.25).astype(int), 0, [w - 1, h - 1]).T
    moments = (weight, weight * (d[:, 0] ** 2 - d[:, 1] ** 2), weight * 2 * d[:, 0] * d[:, 1])
    heat = [np.bincount(y * w + x, t, h * w).reshape(h, w).astype(np.float32) for t in moments]
    mean = 0.25 * float(heat[0].mean())
    windows: List[Tuple[float, Box]] = []
    for side in (44, 72, 116, 190, 290):
        half = side // 2
        total, c, s = (
            cv2.boxFilter(layer, -1, (half, half), normalize=False, borderType=cv2.BORDER_CONSTANT)
            for layer in heat
        )
        # in texture the number of segments is proportional to the area; the target has more of them, in crossing
        # directions, unlike waves and limbs
        crossing = 1.0 - cv2.magnitude(c, s) / np.maximum(total, 1e-6)
        score = (total - mean * side * side) * crossing / side
        radius = half // 2
        for _ in range(2):
            row, col = (int(v) for v in np.unravel_index(int(np.argmax(score)), score.shape))
            if score[row, col] <= 0:
                break
            centre = 2.0 * np.array([col, row]) + 0.5
            # include the centre's own pixel: one just outside would leave the window empty
            inside = (np.abs(x - col) <= radius) & (np.abs(y - row) <= radius)
            # clip segments that leave the window
            p = np.clip(ends[inside].reshape(-1, 2), centre - 0.6 * side, centre + 0.6 * side)
            (x0, y0), (x1, y1) = p.min(axis=0), p.max(axis=0)
            windows.append((float(score[row, col]), (float(x0), float(y0), float(x1), float(y1))))
            score[max(0, row - radius) : row + radius, max(0, col - radius) : col + radius] = -1.0
    windows.sort(key=lambda f: -f[0])
    return [box for _, box in windows[:MAX_WINDOWS]]


def _craft_share(mask: Array, craft_probability: Array) -> float:
    """Return the share of the edges on the target according to the probability map."""
    h, w = craft_probability.shape
    cell = cv2.resize(mask.astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
    # the probability above which `saliency.boxes` scores a pixel for the craft
    is_craft = cv2.dilate((craft_probability > 0.3).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return float(cell[is_craft].sum() / max(float(cell.sum()), 1e-9))


def _share_outside(groups: List[Tuple[int, int, int, int, int]], total: int) -> float:
    """Return the share of ``total`` edges outside the main group; 0 for a few specks."""
    if len(groups) < 2 or total < MIN_EDGES:
        return 0.0
    x0, y0, x1, y1, count = groups[0]
    max_gap = MAX_GAP * float(np.hypot(x1 - x0, y1 - y0))
    for g in groups[1:]:
        if max(g[0] - x1, x0 - g[2], g[1] - y1, y0 - g[3], 0) < max_gap:
            count += g[4]
    return 1.0 - count / total


def _busy_share(mask: Array) -> float:
    """Return the share of tiles of the frame with edges: small for black space, large for the Earth."""
    h, w = mask.shape
    th, tw = h // TILE_PX, w // TILE_PX
    if not th or not tw:
        return 0.0
    tiles = cv2.resize(
        mask[: th * TILE_PX, : tw * TILE_PX].astype(np.float32), (tw, th), interpolation=cv2.INTER_AREA
    )
    return float((tiles > MIN_TILE_EDGES / TILE_PX**2).mean())
