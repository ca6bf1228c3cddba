"""camera.json of SPEED and SPEED+: lengths in metres on the detector, and the matrix in pixels.

Pixel (0, 0) is the centre of the top-left pixel; coefficients are in OpenCV's order.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from msgspec import UNSET

from flyaround.simulator.camera.lens.formats.keys import Keys, Matrix
from flyaround.simulator.camera.lens.formats.lens import camera_file
from flyaround.simulator.camera.lens.formats.opencv import flat_matrix
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

_FOCAL_PX = (("fx_px", "fpx"), ("fy_px", "fpy"))  # focal length, the second as SPEED's utilities name it
_PITCH_UM = 5.86  # pixel pitch of SPEED's camera
_CENTRE_PX = 1.0  # tolerance between matrix and ccx, ccy: some sets count from corners
_LENGTH_TOLERANCE = 2e-3  # tolerance between lengths and matrix, which the sets round


def is_speed(document: Document) -> bool:
    """Return True for camera.json of SPEED, SPEED+ or SHIRT."""
    return {"nu", "nv"} <= document.names


def read_speed(document: Document, source: str) -> CameraFile:
    """Read SPEED's or SPEED+'s camera.json.

    Raises
    ------
    UserError
        If a key is unknown, a length is not positive, or the lengths disagree with the matrix.
    """
    keys = Keys(document.table, source, "SPEED's camera.json")
    width, height = keys.count("Nu"), keys.count("Nv")
    matrix = keys.matrix("cameraMatrix", "K")
    by_length = _by_length(keys, width, height)
    taken = matrix or by_length
    if taken is None:
        raise keys.error("lacks cameraMatrix, or fx, fy, ppx, ppy; add them")
    notes = _disagreement(keys, taken, by_length)
    if notes and matrix is None:
        found = " and ".join(keys.find(*names) or names[0] for names in _FOCAL_PX)
        raise keys.error(f"has keys {found} that disagree with fx, fy, ppx, ppy; delete one pair")
    pitch = None
    if keys.find("ppx") and keys.find("ppy"):
        pitch_x_um, pitch_y_um = (round(keys.number(name) * 1e6, 6) for name in ("ppx", "ppy"))
        pitch = (pitch_x_um, pitch_y_um)
    coefficients, encoding = keys.numbers("distCoeffs"), keys.get("encoding")
    keys.ignore(
        "fx_px",
        "fy_px",
        "name",
        "notes",
        "comment",
        "horizontalFOV",
        "verticalFOV",
        "fov_x",
        "fov_y",
    )
    return camera_file(
        keys,
        (width, height),
        taken,
        "brown_conrady" if coefficients is not None else "none",
        coefficients,
        pixel_pitch_um=pitch,
        notes=notes,
        encoding=encoding,
    )


def _by_length(keys: Keys, width: int, height: int) -> Matrix | None:
    """Return fx, fy, cx, cy from the lengths on the detector, or None."""
    lengths = {name: keys.number(name) for name in ("fx", "fy", "ppx", "ppy") if keys.find(name)}
    for name, length in lengths.items():
        if length <= 0:
            raise UserError(f"{keys.where}: key {name} is {length:g} m, it must be above 0")
    cx, cy = keys.number("ccx", default=width / 2), keys.number("ccy", default=height / 2)
    if len(lengths) < 4:
        return None
    return lengths["fx"] / lengths["ppx"], lengths["fy"] / lengths["ppy"], cx, cy


def _disagreement(keys: Keys, matrix: Matrix, by_length: Matrix | None) -> list[str]:
    """Return a note if other keys contradict the matrix, which the data sets' own programs use."""
    values = [
        *(by_length or matrix)[:2],
        *(keys.number(name, default=value) for name, value in zip(("ccx", "ccy"), matrix[2:], strict=True)),
    ]
    focal_px = [
        keys.number(*names, default=value) for names, value in zip(_FOCAL_PX, matrix[:2], strict=True)
    ]
    is_consistent = np.allclose(matrix[2:], values[2:], rtol=0, atol=_CENTRE_PX)
    if is_consistent and all(
        np.allclose(matrix[:2], focal, rtol=_LENGTH_TOLERANCE) for focal in (values[:2], focal_px)
    ):
        return []
    focal = focal_px if values[:2] == list(matrix[:2]) else values[:2]
    return [
        (
            f"cameraMatrix was taken, with fx, fy, cx, cy {', '.join(f'{v:g}' for v in matrix)} px; the other keys say "
            f"{', '.join(f'{v:g}' for v in (*focal, *values[2:]))} px"
        )
    ]


def write_speed(camera: CameraFile, source: str) -> str:
    """Return the text of SPEED's camera.json.

    Raises
    ------
    UserError
        If the lens is a fish-eye.
    """
    if camera.distortion.model == "kannala_brandt":
        raise UserError(f"{source}: SPEED's camera file has no fisheye lens; write opencv, ros or kalibr")
    K = flat_matrix(camera)
    pitch_x_m, pitch_y_m = (p * 1e-6 for p in camera.pixel_pitch_um or (_PITCH_UM, _PITCH_UM))
    table = {
        "Nu": camera.width_px,
        "Nv": camera.height_px,
        "ppx": pitch_x_m,
        "ppy": pitch_y_m,
        "fx": camera.fx_px * pitch_x_m,
        "fy": camera.fy_px * pitch_y_m,
        "ccx": camera.cx_px,
        "ccy": camera.cy_px,
        "cameraMatrix": [K[:3], K[3:6], K[6:]],
        "distCoeffs": list(camera.distortion.coefficients) or [0.0] * 5,
        **({} if camera.encoding in (UNSET, "linear") else {"encoding": camera.encoding}),
    }
    return json.dumps(table, indent=1) + "\n"
