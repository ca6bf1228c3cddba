"""Likelihood of attitudes under the learned proposal, and the share of the image that each explains, in C."""

from __future__ import annotations

import ctypes
from typing import Any, Tuple

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous
from flyaround.hil.board.svd.native.learned.convolution import whole_numbers

Array = np.ndarray

# What the kernels hold in arrays of their own: harmonics of a bump, side of small pictures [px], shapes, sizes, shifts.
HARMONICS, SIDE, SHAPES, SIZES, SHIFTS = 10, 24, 8, 3, 3


def likelihood(library: ctypes.CDLL, bumps: Array, said: Array, harmonics: Array, circle: Array) -> Array:
    """As ``ViewSubspaces.likelihoods`` of one place: (V * TURNS,) float32.

    Parameters
    ----------
    bumps : (3, V, N) of ``attitudes.turning_bumps``, N a multiple of eight. said : (4, N) of ``attitudes.quartered``.
    harmonics : (HARMONICS + 1,) of a bump. circle : (TURNS, 2) cosine and sine of each turn.
    """
    _, views, n = bumps.shape
    turns = len(circle)
    if n % 8:
        raise ValueError(f"a kernel takes rows of a multiple of 8, not {n}")
    out, at = np.empty(views * turns, np.float32), ctypes.c_void_p
    given = contiguous(said, "float32"), contiguous(harmonics, "float32"), contiguous(circle, "float32")
    shapes = (4, n), (HARMONICS + 1,), (turns, 2)
    run = library.fly_attitude_likelihood
    run.restype = ctypes.c_int64
    failed = run(
        at(checked_pointer(bumps, "float32", (3, views, n))),
        *(at(checked_pointer(a, "float32", shape)) for a, shape in zip(given, shapes)),  # noqa: B905 - 3.9
        ctypes.c_int64(views),
        ctypes.c_int64(turns),
        ctypes.c_int64(n),
        at(checked_pointer(out, "float32")),
    )
    if failed:
        raise MemoryError("no memory for the likelihood of attitudes")
    return out


def likelihoods(library: ctypes.CDLL, views: Any, said: Array) -> Array:  # noqa: ANN401 - ViewSubspaces
    """As ``view_subspaces._likelihoods``: (N, V * TURNS)."""
    harmonics, circle, *_ = views.tables
    return np.stack([likelihood(library, views.bumps, c, harmonics, circle) for c in said])


def packed(basis: Array) -> Tuple[Array, Array]:
    """Shapes (V, SHAPES, SIDE * SIDE) in whole numbers, rows as far apart as the moved picture's, and their worth."""
    views, shapes, _ = basis.shape
    rows = np.zeros((views, shapes, SIDE, SIDE + SHIFTS - 1), np.float32)
    rows[..., :SIDE] = basis.reshape(views, shapes, SIDE, SIDE)
    whole, worth = whole_numbers(rows.reshape(views, shapes, -1))
    return whole, worth.astype(np.float32)


def explained_shares(
    library: ctypes.CDLL,
    views: Any,  # noqa: ANN401 - ViewSubspaces
    picture: Array,
    view: Array,
    turn: Array,
    taken: Array,
) -> Tuple[Array, Array]:
    """As ``view_subspaces._explained_shares``."""
    _, circle, sizes, blur = views.tables
    return explained(library, picture, (view, turn), circle, sizes, blur, views.packed, views.window, taken)


def explained(
    library: ctypes.CDLL,
    picture: Array,
    chosen: Tuple[Array, Array],
    circle: Array,
    sizes: Tuple[float, ...],
    wide: Array,
    basis: Tuple[Array, Array],
    window: Array,
    taken: Array,
) -> Tuple[Array, Array]:
    """Share (C,) that each chosen attitude explains at its best move, and the number of that move (C,).

    Parameters
    ----------
    picture : (n, n). chosen : view and turn (C,) of each. circle : (TURNS, 2). wide : (26, 26) blur of one line, its
        columns the places. basis : of ``packed``. window : (SIDE, SIDE). taken : (V,) share that
        noise gives to so many shapes.
    """
    side, views = len(picture), len(basis[0])
    view, turn = chosen
    if side < 2 or len(sizes) != SIZES or not _within(view, views) or not _within(turn, len(circle)):
        raise ValueError("a kernel takes three sizes, and views and turns that there are")
    # those of one turn together
    order = np.argsort(turn, kind="stable")
    m = SIDE + SHIFTS - 1
    given = (
        (contiguous(picture, "float32"), "float32", (side, side)),
        (contiguous(view[order], "int64"), "int64", (len(view),)),
        (contiguous(turn[order], "int64"), "int64", (len(view),)),
        (contiguous(circle, "float64"), "float64", (len(circle), 2)),
        (np.array(sizes), "float64", (SIZES,)),
        (contiguous(np.stack([wide.T, wide]), "float32"), "float32", (2, m, m)),
        (basis[0], "int16", (views, SHAPES, SIDE * m)),
        (basis[1], "float32", (views, SHAPES)),
        (contiguous(window * window, "float32"), "float32", (SIDE, SIDE)),
        (contiguous(taken, "float64"), "float64", (views,)),
    )
    share, move = np.empty(len(view)), np.empty(len(view), np.int64)
    at = [ctypes.c_void_p(checked_pointer(*one)) for one in given]
    library.fly_subspace_match(
        at[0],
        ctypes.c_int64(side),
        *at[1:3],
        ctypes.c_int64(len(view)),
        *at[3:],
        ctypes.c_void_p(checked_pointer(share, "float64")),
        ctypes.c_void_p(checked_pointer(move, "int64")),
    )
    back = np.empty(len(order), np.intp)
    back[order] = np.arange(len(order))
    return share[back], move[back]


def _within(numbers: Array, count: int) -> bool:
    return not len(numbers) or (int(numbers.min()) >= 0 and int(numbers.max()) < count)
