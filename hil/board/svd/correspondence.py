"""Feature correspondence: matches perceptual groups of image lines with wireframe groups, and solves their poses.

Each pair of groups of the same kind is a hypothesis, solved by EPnP (Sharma, Ventura & D'Amico 2018, pose
determination). The Milan thesis instead solves P3P for three random points of a pair and counts inliers (RANSAC,
Fischler & Bolles 1981).
"""

from __future__ import annotations

from typing import Any, Iterator, List, Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics, undistorted_rays
from flyaround.hil.board.svd.perceptual_groups import PointGroups
from flyaround.hil.board.svd.pose_solvers import from_rotvecs, point_solver, three_point_poses
from flyaround.hil.board.svd.settings import PublishedConfig

Array = np.ndarray
Pairs = Tuple[Array, Array]

# Largest number of pairs to solve, which bounds the run time.
MAX_PAIRS = 6000

# Seed of RANSAC's samples: any number, the same for every image, so that a board repeats its answer.
SEED = 2018

# Minimum number of points of each solver.
MIN_POINTS = {"p3p": 3, "ap3p": 4, "epnp": 4, "sqpnp": 4, "ippe": 4, "iterative": 4}

# Kinds of groups in the order in which the budget is distributed, most distinctive first; True: with an antenna.
GROUP_ORDER = (
    ("closed_tetrad", True),
    ("open_tetrad", False),
    ("closed_tetrad", False),
    ("open_triad", True),
    ("open_triad", False),
    ("proximity_pair", True),
    ("parallel_pair", False),
)


def correspondences(image: PointGroups, model: PointGroups, budget: int = MAX_PAIRS) -> Iterator[Pairs]:
    """Yield the pairs of one kind of group at a time: image points (N, P, 2) and model points (N, P, 3).

    Notes
    -----
    The published search combines a polygon with an antenna, if there is one, so that the points are not coplanar.
    Each kind gets an equal share of the remaining budget; if it has more pairs, they are subsampled uniformly.
    """
    remaining = budget
    for k, (kind, with_antenna) in enumerate(GROUP_ORDER):
        share = remaining // (len(GROUP_ORDER) - k)
        pairs = _pairs(image, model, kind, with_antenna=with_antenna)
        total = pairs.shape[0]
        subset = pairs if total <= share else pairs[np.linspace(0, total - 1, share).astype(int)]
        remaining -= len(subset)
        i, m, a, b = subset.T
        points, target = image.of_kind(kind)[i], model.of_kind(kind)[m]
        if with_antenna:
            points = np.concatenate([points, image.of_kind("antenna")[a]], axis=1)
            target = np.concatenate([target, model.of_kind("antenna")[b]], axis=1)
        yield points, target


def _pairs(image: PointGroups, model: PointGroups, kind: str, *, with_antenna: bool) -> Array:
    """Return indices (N, 4): image group, model group, image antenna, model antenna."""
    counts = [len(image.of_kind(kind)), len(model.of_kind(kind)), 1, 1]
    if with_antenna:
        counts[2:] = [len(image.of_kind("antenna")), len(model.of_kind("antenna"))]
    return np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 4)


def solve_all(
    image: PointGroups, model: PointGroups, camera: CameraIntrinsics, config: PublishedConfig
) -> Tuple[Array, Array, int]:
    """Return all pose solutions of all pairs, q (N, 4) and t (N, 3), and the number of pairs solved.

    Notes
    -----
    With RANSAC, the solver receives three random points of a pair, so that one wrong corner of four need not spoil the
    pose. Inliers are counted afterwards, for all poses together.
    """
    rng = np.random.default_rng(SEED)
    needed = MIN_POINTS[config.solver]
    rays = PointGroups(
        {
            kind: undistorted_rays(camera, p.reshape(-1, 2)).reshape(p.shape)
            for kind, p in image.by_kind.items()
        }
    )
    rotations, translations = [np.zeros((0, 4))], [np.zeros((0, 3))]
    n_solved = 0
    for points, target in correspondences(rays, model):
        n, size = points.shape[:2]
        n_solved += n
        selection: Any = slice(None)
        if config.ransac and size > needed:
            samples = np.array([rng.permutation(size) for _ in range(n)], int).reshape(n, size)
            selection = np.arange(n)[:, None], np.sort(samples[:, :needed], axis=1)
        elif config.solver in ("p3p", "ap3p"):
            selection = np.s_[:, :needed]
        q, t = _poses(target[selection], points[selection], config.solver)
        rotations.append(q)
        translations.append(t)
    return np.concatenate(rotations), np.concatenate(translations), n_solved


def _poses(target: Array, points: Array, solver: str) -> Tuple[Array, Array]:
    """Solve the poses of model points (N, P, 3) at image points (N, P, 2); P3P is vectorised over the pairs."""
    if solver == "p3p":
        q, t, _ = three_point_poses(target, points)
        return q, t
    solve = point_solver(solver)
    rotations: List[Array] = []
    translations: List[Array] = []
    for figure, image_points in zip(target, points):  # noqa: B905 - Python 3.9 has no strict=
        turn, shift = solve(figure, image_points)
        rotations += turn
        translations += shift
    return from_rotvecs(rotations, translations)
