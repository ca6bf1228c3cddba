"""Conversion of another program's numbers to a camera: lens models, numbers of coefficients, bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.camera.lens.distortion import COEFFICIENT_COUNTS, DistortionModel
from flyaround.simulator.camera.lens.files_native import CameraFile
from flyaround.simulator.camera.lens.formats.document import plain_name
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.simulator.camera.lens.formats.keys import Keys

_RECALIBRATE = (
    "calibrate with radial and tangential terms (cv2.calibrateCamera, Kalibr's pinhole-radtan) or with the equidistant "
    "fish-eye (cv2.fisheye.calibrate, Kalibr's pinhole-equi)"
)
# names of the models in other programs' files, without _, - and blanks
_BROWN = "plumbbob rationalpolynomial rational radtan radialtangential brownconrady brown opencv standard"
_FISHEYE = "equidistant equi fisheye opencvfisheye kannalabrandt kannalabrandt4 kannalabrandt8 kb4"
_NEUTRAL = ("", "pinhole", "perspective")


def named_model(names: Iterable[tuple[str, object]], keys: Keys) -> DistortionModel | None:
    """Return the lens model that a file's keys name; None if none does.

    Parameters
    ----------
    names : iterable of tuple
        Pairs of a key and its value.
    keys : Keys
        Keys of the file, for messages.

    Raises
    ------
    UserError
        If a model is not supported, or two keys name different ones.
    """
    models: dict[DistortionModel, str] = {}
    for key, value in names:
        name = plain_name(value or "")
        if name in _NEUTRAL:
            continue
        if name == "none":
            models["none"] = key
        elif name in _BROWN.split():
            models["brown_conrady"] = key
        elif name in _FISHEYE.split():
            models["kannala_brandt"] = key
        else:
            location = f"{keys.where}: key {keys.path}{key}"
            raise unsupported_model(
                location, value, "plumb_bob, rational_polynomial, radtan, equidistant, fisheye, none"
            )
    if len(models) > 1:
        first, second = list(models.values())[:2]
        raise UserError(
            f"{keys.where}: keys {first} and {second} name different lenses; delete the wrong one"
        )
    return next(iter(models), None)


def unsupported_model(location: str, value: object, supported: str) -> UserError:
    """Return the error for an unsupported lens model, with the alternative.

    Parameters
    ----------
    location : str
        File and key.
    value : object
        Value of the key.
    supported : str
        Names of the models that are read.
    """
    return UserError(
        f"{location} is {str(value)[:60]!r}, a lens that is not supported (read are {supported}); {_RECALIBRATE}"
    )


def camera_file(
    keys: Keys,
    size: Sequence[float],
    intrinsics: Sequence[float],
    model: DistortionModel,
    coefficients: Sequence[float] | None,
    *,
    name: str = "",
    notes: Iterable[str] = (),
    pixel_pitch_um: tuple[float, float] | None = None,
    encoding: object = None,
) -> CameraFile:
    """Build the camera of a file, once all of its keys are read or ignored by name.

    Parameters
    ----------
    keys : Keys
        Keys of the file; `Keys.done` is called.
    size : sequence of float
        Width and height of the image.
    intrinsics : sequence of float
        fx, fy, cx, cy; pixel (0, 0) is the centre of the top-left pixel.
    model : DistortionModel
        Lens model.
    coefficients : sequence of float or None
        Coefficients of the model in OpenCV's order, or None.
    name : str, optional
        Name of the camera.
    notes : iterable of str, optional
        Remarks for the user about other content of the file.
    pixel_pitch_um : tuple of float, optional
        Horizontal and vertical pixel pitch [um], or None.
    encoding : object, optional
        Transfer function of the images as the file names it, or None.

    Raises
    ------
    UserError
        If a key is unread, the coefficients are missing or too many, or a number is out of bounds.
    """
    keys.done()
    source = keys.where
    fx, fy, cx, cy = intrinsics
    if min(fx, fy) <= 0:
        raise UserError(
            f"{source}: the camera matrix is singular: its focal lengths are {fx:g} and {fy:g} px, both must be above 0"
        )
    table = {
        "width_px": whole_pixels(size[0], source),
        "height_px": whole_pixels(size[1], source),
        "fx_px": fx,
        "fy_px": fy,
        "cx_px": cx,
        "cy_px": cy,
        "distortion": _distortion(model, coefficients, source),
        "pixel_pitch_um": pixel_pitch_um,
        "name": "".join(c for c in name[:200] if c.isprintable()),
        "notes": "; ".join(notes),
    }
    if encoding is not None:
        table["encoding"] = encoding
    try:
        return msgspec.convert(table, CameraFile)
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {error}") from error


def _distortion(
    model: DistortionModel, coefficients: Sequence[float] | None, source: str
) -> dict[str, object]:
    if coefficients is None or (not coefficients and model != "none"):
        if model != "none":
            raise UserError(f"{source} names the lens model {model} but has no coefficients for it; add them")
        coefficients = ()
    if model == "none":
        if any(coefficients):
            raise UserError(
                f"{source} has coefficients of a distortion, but names a lens without one; delete them"
            )
        return {"model": "none", "coefficients": ()}
    counts = COEFFICIENT_COUNTS[model]
    if len(coefficients) > counts[-1]:
        if model == "brown_conrady" and any(coefficients[counts[-1] :]):
            raise UserError(
                f"{source}: thin prism and tilt terms of the distortion are not supported; calibrate without them"
            )
        if model == "brown_conrady":
            coefficients = coefficients[: counts[-1]]
    if len(coefficients) not in counts:
        counts_text = " or ".join(map(str, counts))
        raise UserError(
            f"{source} has {len(coefficients)} coefficients of the lens, {model} takes {counts_text}"
        )
    if model == "brown_conrady" and not any(coefficients):
        return {"model": "none", "coefficients": ()}
    # an ideal fish-eye has all coefficients zero, and is not a pinhole
    return {"model": model, "coefficients": tuple(coefficients)}


def whole_pixels(value: float, source: str) -> int:
    """Return a size in pixels as an integer.

    Raises
    ------
    UserError
        If it is not a whole number.
    """
    if value != int(value):
        raise UserError(
            f"{source}: the image is {value:g} pixels wide or high, a whole number of pixels is needed"
        )
    return int(value)
