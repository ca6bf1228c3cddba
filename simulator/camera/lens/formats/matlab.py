"""MATLAB's cameraParameters and cameraIntrinsics as JSON.

MATLAB puts (1, 1) at the centre of the top-left pixel: one pixel is subtracted from its principal points. ImageSize is
rows, columns; IntrinsicMatrix multiplies row vectors, so it is the transpose of K.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.lens.formats.keys import Keys, camera_matrix
from flyaround.simulator.camera.lens.formats.lens import camera_file, unsupported_model

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

PRINCIPAL_POINT_SHIFT_PX = -1.0  # from MATLAB's pixels, counted from 1, to ours, counted from 0
_FISHEYE = ("MappingCoefficients", "StretchMatrix", "DistortionCenter")
_LENS = (
    *("FocalLength", "PrincipalPoint", "ImageSize", "RadialDistortion", "TangentialDistortion", "Skew"),
    *("IntrinsicMatrix", "K"),
)
_REPORT = """
    RotationVectors TranslationVectors RotationMatrices PatternExtrinsics ReprojectionErrors ReprojectedPoints
    WorldPoints WorldUnits EstimateSkew EstimateTangentialDistortion Version NumRadialDistortionCoefficients
    MeanReprojectionError NumPatterns DetectedKeypoints Class NumberOfPatterns
"""


def is_matlab(document: Document) -> bool:
    """Return True for MATLAB's camera parameters."""
    marks = ("FocalLength", "IntrinsicMatrix", "Intrinsics", "RadialDistortion", "ImageSize", *_FISHEYE)
    return any(mark in document.table for mark in marks)


def read_matlab(document: Document, source: str) -> CameraFile:
    """Read jsonencode of cameraIntrinsics, of cameraParameters, or of its toStruct.

    Raises
    ------
    UserError
        If a key is unknown, or the lens is MATLAB's own fish-eye.
    """
    keys = Keys(document.table, source, "MATLAB's cameraParameters")
    keys.ignore(_REPORT)
    if keys.find("Intrinsics"):
        keys = _joined(keys, source)
    if any(keys.find(name) for name in _FISHEYE):
        raise unsupported_model(
            f"{source}: its class", "fisheyeIntrinsics", "cameraParameters, cameraIntrinsics"
        )
    size = keys.numbers("ImageSize")
    if not size or len(size) != 2:
        raise keys.error("lacks ImageSize [rows, columns]: set it in MATLAB, or add it")
    intrinsics = _intrinsics(keys)
    radial, tangential = (keys.numbers(name) for name in ("RadialDistortion", "TangentialDistortion"))
    coefficients = None
    if radial is not None or tangential is not None:
        radial, tangential = radial or [0.0, 0.0], tangential or [0.0, 0.0]
        if len(radial) not in (2, 3) or len(tangential) != 2:
            raise keys.error(
                f"has {len(radial)} radial and {len(tangential)} tangential terms, allowed: 2 or 3, and 2"
            )
        coefficients = [*radial[:2], *tangential, *radial[2:]]
    if abs(keys.number("Skew", default=0.0)) > 1e-9 * abs(intrinsics[0]):
        raise keys.error("has a Skew, which is not supported; calibrate with EstimateSkew false")
    return camera_file(
        keys, size[::-1], intrinsics, "brown_conrady" if coefficients else "none", coefficients
    )


def _joined(outer: Keys, source: str) -> Keys:
    """Return the keys of Intrinsics with those of the lens beside it, which cameraParameters repeats.

    Raises
    ------
    UserError
        If a key has other numbers beside Intrinsics than in it, or is unknown.
    """
    inner = outer.inner("Intrinsics")
    table = dict(outer.get("Intrinsics"))
    for name in filter(outer.find, _LENS):
        beside, within = outer.numbers(name) or [], inner.numbers(name)
        if within is None:
            table[name] = outer.get(name)
        elif np.shape(beside) != np.shape(within) or not np.allclose(beside, within, rtol=1e-6):
            raise outer.error(
                f"has a key {name} beside Intrinsics that disagrees with the one in it; delete one"
            )
    outer.done()
    return Keys(table, source, outer.form, inner.path)


def _intrinsics(keys: Keys) -> list[float]:
    """Return fx, fy, cx, cy from the keys that exist.

    Raises
    ------
    UserError
        If there are none, one has another count of numbers, or they disagree.
    """
    matrices = {}
    names = ("FocalLength", "PrincipalPoint")
    pairs = [keys.numbers(name) for name in names]
    if pairs != [None, None]:
        for name, pair in zip(names, pairs, strict=True):
            if pair is None or len(pair) != 2:
                raise keys.error(f"needs 2 numbers as {name}, not {len(pair or [])}")
        matrices[" and ".join(names)] = [v for pair in pairs for v in pair or []]
    for name, transposed in (("IntrinsicMatrix", True), ("K", False)):
        m = keys.numbers(name)
        if m is not None:
            rows = np.reshape(m, (3, 3)).T.ravel().tolist() if transposed and len(m) == 9 else m
            matrices[name] = list(camera_matrix(rows, f"{keys.where}: key {name}"))
    if not matrices:
        raise keys.error("lacks FocalLength and PrincipalPoint, or K; add them")
    first, *others = matrices
    for name in others:
        if not np.allclose(matrices[name], matrices[first], rtol=1e-6):
            raise keys.error(f"has a key {name} that disagrees with {first}; delete one")
    fx, fy, cx, cy = matrices[first]
    return [fx, fy, cx + PRINCIPAL_POINT_SHIFT_PX, cy + PRINCIPAL_POINT_SHIFT_PX]
