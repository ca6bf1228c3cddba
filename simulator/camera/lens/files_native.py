"""CAMERA.json as a typed file."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, Meta, UnsetType

from flyaround.simulator.camera.encoding import Encoding
from flyaround.simulator.camera.lens.camera_model import (
    CENTRE_PX,
    FOCAL_PX,
    MAX_IMAGE_PX,
    Camera,
    Distortion,
    camera_problem,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.sections import within

# a region or a binned image may be smaller than any camera
SizePx = Annotated[int, Meta(ge=16, le=MAX_IMAGE_PX)]
FocalPx = Annotated[float, within(FOCAL_PX)]
CentrePx = Annotated[float, within(CENTRE_PX)]
PitchUm = Annotated[float, Meta(ge=0.1, le=1000)]


class DistortionSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Lens distortion: OpenCV's models, coefficients in OpenCV's order."""

    model: Literal["none", "brown_conrady", "kannala_brandt"] = "none"
    coefficients: tuple[float, ...] = ()


class CameraFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The camera object of CAMERA.json; pixel (0, 0) is the centre of the top-left pixel.

    ``pixel_pitch_um``, across and down, is the default for a scenario's. ``encoding`` is the transfer function of the
    images; if absent, they are linear, or as the scenario's ``output.encoding``.
    """

    width_px: SizePx
    height_px: SizePx
    fx_px: FocalPx
    fy_px: FocalPx
    cx_px: CentrePx
    cy_px: CentrePx
    distortion: DistortionSection = DistortionSection()
    encoding: Encoding | UnsetType = UNSET
    pixel_pitch_um: tuple[PitchUm, PitchUm] | None = None
    name: str = ""
    notes: str = ""

    def camera(self, source: str) -> Camera:
        """Return the camera model.

        Returns
        -------
        Camera
            Intrinsics, lens and encoding of the images, checked over the whole image.

        Raises
        ------
        UserError
            If the lens is impossible, for example folds back inside the image; ``source`` names the file.
        """
        try:
            distortion = Distortion(self.distortion.model, self.distortion.coefficients)
        except ValueError as error:
            raise UserError(f"{source}: key {error}") from error
        camera = Camera(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=self.fx_px,
            fy_px=self.fy_px,
            cx_px=self.cx_px,
            cy_px=self.cy_px,
            distortion=distortion,
            encoding=self.encoding,
        )
        problem = camera_problem(camera)
        if problem is not None:
            raise UserError(f"{source}: key {problem}")
        return camera
