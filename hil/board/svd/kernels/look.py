"""Likelihood of the first look's attitudes by the C kernels: look.c."""

from __future__ import annotations

import ctypes

import numpy as np

from hil.board.svd.kernels.library import address, laid

Array = np.ndarray

# A bump of one, in steps.
STEPS = 65535


def quantised(bumps: Array) -> Array:
    """Values 0..1 as uint16, half a step off at most."""
    return np.rint(np.asarray(bumps) * STEPS).astype(np.uint16)


def restored(bumps: Array) -> Array:
    """float32 values of ``quantised`` ones."""
    return bumps * np.float32(1.0 / STEPS)


def likelihood(library: ctypes.CDLL, bumps: Array, coefficients: Array, views: int, turns: int) -> Array:
    """As ``Subspaces.likelihood``: (views * turns,) float32.

    Parameters
    ----------
    bumps : (views * turns, N) uint16 of ``quantised``, N a multiple of eight. coefficients : (4, N).
    """
    n = bumps.shape[1]
    if n % 8 or turns % len(coefficients):
        raise ValueError(f"a kernel takes rows of a multiple of 8, not {n}, and turns of 4, not {turns}")
    mean, out = laid(coefficients, "float32"), np.empty(views * turns, np.float32)
    library.fly_likelihood(
        ctypes.c_void_p(address(bumps, "uint16", (views * turns, n))),
        ctypes.c_void_p(address(mean, "float32", (4, n))),
        ctypes.c_int64(views),
        ctypes.c_int64(turns),
        ctypes.c_int64(n),
        ctypes.c_void_p(address(out, "float32")),
    )
    return out
