"""Which samples of the wireframe a camera sees, in C."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.wireframe import EdgeSamples, OccludingTriangles

Array = np.ndarray


class _Samples(ctypes.Structure):
    """visibility.c: struct samples."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("points", "tangents", "radius", "normals", "faces")),
        ("n", ctypes.c_int64),
    ]


class _Occluders(ctypes.Structure):
    """visibility.c: struct occluders."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("v0", "e1", "e2", "n")),
        ("triangles", ctypes.c_int64),
    ]


def packed_samples(samples: EdgeSamples) -> Tuple[Any, Tuple[Array, ...]]:
    """The samples as C takes them, and what keeps their arrays alive; kept for the next call."""
    if "packed" not in samples.kept:
        samples.kept["packed"] = _packed_samples(samples)
    struct: Tuple[Any, Tuple[Array, ...]] = samples.kept["packed"]
    return struct


def _packed_samples(samples: EdgeSamples) -> Tuple[Any, Tuple[Array, ...]]:
    given = (samples.points_m, samples.tangents, samples.radius_m, samples.normals)
    arrays = (*(contiguous(a, "float64") for a in given), contiguous(samples.faces, "int64"))
    n = len(samples)
    shapes = ((n, 3), (n, 3), (n,), (n, 2, 3), (n,))
    at = [checked_pointer(a, a.dtype.name, shape) for a, shape in zip(arrays, shapes)]  # noqa: B905 - 3.9
    return _Samples(*at, n), arrays


def packed_occluders(occ: OccludingTriangles) -> Tuple[Any, Tuple[Array, ...]]:
    """The triangles as C takes them, and what keeps their arrays alive; kept for the next call."""
    if "packed" not in occ.kept:
        occ.kept["packed"] = _packed_occluders(occ)
    struct: Tuple[Any, Tuple[Array, ...]] = occ.kept["packed"]
    return struct


def _packed_occluders(occ: OccludingTriangles) -> Tuple[Any, Tuple[Array, ...]]:
    arrays = tuple(contiguous(a, "float64") for a in (occ.v0, occ.e1, occ.e2, occ.n))
    n = len(occ.v0)
    return _Occluders(*(checked_pointer(a, "float64", (n, 3)) for a in arrays), n), arrays


def visible_samples(
    library: ctypes.CDLL, samples: EdgeSamples, occ: OccludingTriangles, C_m: Array
) -> Tuple[Array, Array]:
    """As ``visibility.visible_samples``."""
    C = contiguous(C_m, "float64")
    visible, outline = np.empty(len(samples), bool), np.empty(len(samples), bool)
    failed = library.fly_visible_samples(
        ctypes.byref(packed_samples(samples)[0]),
        ctypes.byref(packed_occluders(occ)[0]),
        ctypes.c_void_p(checked_pointer(C, "float64", (3,))),
        ctypes.c_void_p(checked_pointer(visible, "bool")),
        ctypes.c_void_p(checked_pointer(outline, "bool")),
    )
    if failed:
        raise MemoryError("no memory to see what hides the wireframe")
    return visible, outline
