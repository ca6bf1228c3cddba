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

ONE_BASED_PX = -1.0  # MATLAB counts pixels from (1, 1) at the centre of the first
_FISHEYE = ("MappingCoefficients", "StretchMatrix", "DistortionCenter")
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
        inner = keys.inner("Intrinsics")
        # cameraParameters repeats its intrinsics next to the object
        keys.ignore(
            "FocalLength", "PrincipalPoint", "ImageSize", "RadialDistortion", "TangentialDistortion", "Skew"
        )
        keys.ignore("IntrinsicMatrix", "K")
        keys.done()
        keys = inner
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
            raise keys.error("has other than 2 or 3 radial and 2 tangential terms, which MATLAB does not")
        coefficients = [*radial[:2], *tangential, *radial[2:]]
    if abs(keys.number("Skew", default=0.0)) > 1e-9 * intrinsics[0]:
        raise keys.error("has a Skew, which is not drawn: calibrate with EstimateSkew false")
    return camera_file(
        keys, size[::-1], intrinsics, "brown_conrady" if coefficients else "none", coefficients
    )


def _intrinsics(keys: Keys) -> list[float]:
    """Return fx, fy, cx, cy from the keys that exist.

    Raises
    ------
    UserError
        If there are none, or they disagree.
    """
    matrices = []
    focal, centre = keys.numbers("FocalLength"), keys.numbers("PrincipalPoint")
    if focal and centre and len(focal) == len(centre) == 2:
        matrices.append([*focal, *centre])
    for name, transposed in (("IntrinsicMatrix", True), ("K", False)):
        m = keys.numbers(name)
        if m is not None:
            rows = np.reshape(m, (3, 3)).T.ravel().tolist() if transposed and len(m) == 9 else m
            matrices.append(list(camera_matrix(rows, f"{keys.where}: key {name}")))
    if not matrices:
        raise keys.error("lacks FocalLength and PrincipalPoint, or K; add them")
    if not np.allclose(matrices, matrices[0], rtol=1e-6):
        raise keys.error("has a matrix that disagrees with FocalLength and PrincipalPoint; delete one")
    fx, fy, cx, cy = matrices[0]
    return [fx, fy, cx + ONE_BASED_PX, cy + ONE_BASED_PX]
