"""Intrinsics from a data sheet: focal length, pixel pitch, sensor size, aperture angle."""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from flyaround.simulator.camera.lens.files_native import CameraFile, CentrePx, DistortionSection, SizePx
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.validation_errors import convert_document

CONSISTENCY_TOLERANCE = 2e-3
"""Relative tolerance between two derivations of the same number; data sheets are rounded."""
MIN_ANGLE_DEG = 1e-4
"""Smallest aperture angle: a third of an arc second, below that of any telescope's detector."""
_Positive = Annotated[float, Meta(gt=0, le=1e6)]
# a list, not a tuple: msgspec 0.22 corrupts memory on a union of a number and a fixed tuple
_Pair = _Positive | Annotated[list[_Positive], Meta(min_length=2, max_length=2)]


class LensFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A camera by its data sheet: two of its focal length, pixel pitch and detector size, or its aperture angle alone.

    With pitch d, number of pixels N and focal length f: sensor size s = d N, aperture angle alpha = 2 atan(d N / 2 f),
    focal length in pixels f / d; each across and down, if two numbers are given.
    """

    width_px: SizePx
    height_px: SizePx
    focal_length_mm: Annotated[float, Meta(gt=0, le=1e5)] | None = None
    pixel_pitch_um: _Pair | None = None
    sensor_size_mm: _Pair | None = None
    aperture_angle_deg: _Pair | None = None
    cx_px: CentrePx | None = None
    cy_px: CentrePx | None = None
    distortion: DistortionSection = DistortionSection()
    name: str = ""
    notes: str = ""

    def solve(self, source: str) -> CameraFile:
        """Return the camera in pixels; the principal point defaults to the image's centre.

        Raises
        ------
        UserError
            If values are missing or contradict each other.
        """
        pitch = _per_axis(self.pixel_pitch_um, repeat=True)
        size, angle = (_per_axis(v, repeat=False) for v in (self.sensor_size_mm, self.aperture_angle_deg))
        fx = self._focal_px(source, self.width_px, pitch[0], size[0], angle[0])
        fy = self._focal_px(source, self.height_px, pitch[1], size[1], angle[1])
        if fx is None:
            raise UserError(
                f"{source}: the intrinsics are not fixed: give focal_length_mm with pixel_pitch_um or sensor_size_mm, "
                "or aperture_angle_deg"
            )
        pixel_um = self._pitch_um(pitch, size, fx, fy)
        if fy is None:
            # the focal length in millimetres is the same along both axes, in pixels only if they are square
            fy = fx if pixel_um is None else fx * pixel_um[0] / pixel_um[1]
        elif pixel_um is not None:
            _agreed_value(
                source,
                "the focal length [mm]",
                fx * pixel_um[0] * 1e-3,
                fy * pixel_um[1] * 1e-3,
                ("across", "down: correct the numbers of one axis"),
            )
        camera = CameraFile(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=fx,
            fy_px=fy,
            cx_px=(self.width_px - 1) / 2 if self.cx_px is None else self.cx_px,
            cy_px=(self.height_px - 1) / 2 if self.cy_px is None else self.cy_px,
            distortion=self.distortion,
            pixel_pitch_um=pixel_um,
            name=self.name,
            notes=self.notes,
        )
        # building the struct checks no bounds; converting its document does
        return convert_document(
            msgspec.to_builtins(camera), CameraFile, f"{source}: the camera of these numbers"
        )

    def _pitch_um(
        self,
        pitch: tuple[float | None, float | None],
        size: tuple[float | None, float | None],
        fx: float,
        fy: float | None,
    ) -> tuple[float, float] | None:
        """Return the pixel pitch across and down, if given directly or by detector size or focal length."""
        pitch_x_um, pitch_y_um = (
            d if d is not None or s is None else s / count * 1e3
            for d, s, count in zip(pitch, size, (self.width_px, self.height_px), strict=True)
        )
        if self.focal_length_mm is not None:
            pitch_x_um = pitch_x_um or self.focal_length_mm * 1e3 / fx
            pitch_y_um = pitch_y_um or (self.focal_length_mm * 1e3 / fy if fy is not None else pitch_x_um)
        return None if pitch_x_um is None else (pitch_x_um, pitch_y_um or pitch_x_um)

    def _focal_px(
        self, source: str, count: int, pitch_um: float | None, size_mm: float | None, angle_deg: float | None
    ) -> float | None:
        """Return the focal length over the pitch along one axis."""
        by_size = None if size_mm is None else size_mm / count * 1e3
        d_um = _agreed_value(source, "the pixel pitch [um]", pitch_um, by_size)
        by_length = None
        if self.focal_length_mm is not None and d_um is not None:
            by_length = self.focal_length_mm * 1e3 / d_um
        by_angle = None
        if angle_deg is not None:
            if angle_deg >= 180:
                raise UserError(f"{source}: key aperture_angle_deg is {angle_deg:g}, allowed: less than 180")
            if angle_deg < MIN_ANGLE_DEG:
                raise UserError(
                    f"{source}: key aperture_angle_deg is {angle_deg:g}, allowed: at least {MIN_ANGLE_DEG:g}"
                )
            by_angle = count / (2 * float(np.tan(np.radians(angle_deg) / 2)))
        return _agreed_value(source, "the focal length in pixels", by_length, by_angle)


def _per_axis(value: float | list[float] | None, *, repeat: bool) -> tuple[float | None, float | None]:
    """Return the values across and down; a single number is used for both if ``repeat``, else only across."""
    if value is None:
        return None, None
    if isinstance(value, list):
        return value[0], value[1]
    return value, value if repeat else None


def _agreed_value(
    source: str,
    quantity: str,
    first: float | None,
    second: float | None,
    origins: tuple[str, str] = ("by one pair of keys", "by another; leave one out"),
) -> float | None:
    """Return the value on which two derivations agree, or the only one; raise UserError if they disagree."""
    if first is None or second is None:
        return second if first is None else first
    if abs(first / second - 1) > CONSISTENCY_TOLERANCE:
        raise UserError(f"{source}: {quantity} is {first:.6g} {origins[0]} and {second:.6g} {origins[1]}")
    return first
