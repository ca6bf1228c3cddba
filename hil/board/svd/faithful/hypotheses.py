"""Poses from pairs of groups: every group of the picture as every group of its kind on the wireframe."""

from __future__ import annotations

from typing import Any, Iterator, List, Tuple

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.faithful.config import FaithfulConfig
from hil.board.svd.faithful.figures import Figures
from hil.board.svd.model import CameraIntrinsics
from hil.board.svd.pnp import point_solver, undistorted_rays

Array = np.ndarray
Pair = Tuple[Array, Array]

# Pairs of groups solved at most: the search must end.
BUDGET = 6000

# Share of the budget of each combination, the most telling first.
ORDER = (
    ("closed_tetrad", True),
    ("open_tetrad", False),
    ("closed_tetrad", False),
    ("open_triad", True),
    ("open_triad", False),
    ("proximity_pair", True),
    ("parallel_pair", False),
)


def correspondences(image: Figures, model: Figures, budget: int = BUDGET) -> Iterator[Pair]:
    """Pairs of picture points (P, 2) and model points (P, 3), four to six of each; with an antenna where there is one.

    Notes
    -----
    The published search joins a polygon with an antenna where it finds one, for six points that do not lie in
    one plane; each combination gets an even share of what is left of the budget, picked evenly.
    """
    left = budget
    for k, (kind, with_antenna) in enumerate(ORDER):
        share = left // (len(ORDER) - k)
        pairs = _pairs(image, model, kind, with_antenna=with_antenna)
        total = pairs.shape[0]
        chosen = pairs if total <= share else pairs[np.linspace(0, total - 1, share).astype(int)]
        left -= len(chosen)
        for i, m, a, b in chosen:
            points, target = image.of(kind)[i], model.of(kind)[m]
            if with_antenna:
                points = np.concatenate([points, image.of("antenna")[a]])
                target = np.concatenate([target, model.of("antenna")[b]])
            yield points, target


def _pairs(image: Figures, model: Figures, kind: str, *, with_antenna: bool) -> Array:
    """(N, 4) indices: picture group, model group, picture antenna, model antenna."""
    counts = [len(image.of(kind)), len(model.of(kind)), 1, 1]
    if with_antenna:
        counts[2:] = [len(image.of("antenna")), len(model.of("antenna"))]
    return np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 4)


def solve_all(
    image: Figures, model: Figures, camera: CameraIntrinsics, config: FaithfulConfig
) -> Tuple[Array, Array, int]:
    """Every pose of every pair: q (N, 4), t (N, 3), and the number of pairs solved.

    Notes
    -----
    With RANSAC three points of the pair are drawn at random for the solver, so that one bad corner of four does not
    spoil the figure; inliers are counted afterwards for all poses together.
    """
    rng = np.random.default_rng(2018)
    solve = point_solver(config.solver)
    needed = _needed(config.solver)
    turns: List[Array] = []
    shifts: List[Array] = []
    solved = 0
    rays = Figures(
        {
            kind: undistorted_rays(camera, p.reshape(-1, 2)).reshape(p.shape)
            for kind, p in image.by_kind.items()
        }
    )
    for points, target in correspondences(rays, model):
        used: Any = slice(None)
        if config.ransac and len(points) > needed:
            used = np.sort(rng.permutation(len(points))[:needed])
        elif config.solver in ("p3p", "ap3p"):
            used = slice(needed)
        for turn, shift in zip(*solve(target[used], points[used])):  # noqa: B905 - Python 3.9 has no strict=
            turns.append(turn)
            shifts.append(shift)
        solved += 1
    v, t = np.array(turns).reshape(-1, 3), np.array(shifts).reshape(-1, 3)
    return quat.normalise(quat.from_rotvec(v)), t, solved


def _needed(solver: str) -> int:
    """Points a solver takes at least."""
    return {"p3p": 3, "ap3p": 4, "epnp": 4, "sqpnp": 4, "ippe": 4, "iterative": 4}[solver]
