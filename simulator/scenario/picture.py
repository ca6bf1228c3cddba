"""The tables of a scenario file that say what the picture is: sensor and output."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from simulator.camera.sections import DetectorSection
from simulator.imaging.auto_exposure import AutoExposure
from simulator.runtime.sections import Section
from simulator.scene.state import Bands, Quality

Pitch = Annotated[float, Meta(gt=0.1, le=1000)]
Layer = Literal["all", "amodal", "parts", "depth", "normals", "flow", "clean", "wireframe"]


class SensorSection(Section, frozen=True, kw_only=True):
    """Noise recipe or detector by name, exposure, and what of it to change.

    With a detector (``imx174``, ``cmv4000``, or a section `[sensor.detector]`) photons and electrons are counted and
    ``full_scale_j_m2_sr`` and the two variances have no part. ``roi_px`` (x0, y0, width, height) reads a region of the
    camera's pixels, ``binning`` joins them by so many in width and height; the camera becomes that of the image.
    """

    preset: Literal["speed", "thesis", "ideal", "imx174", "cmv4000"] = "speed"
    exposure_s: Annotated[float, Meta(gt=0, le=10)] = 0.001
    full_scale_j_m2_sr: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    blur_sigma_px: Annotated[float, Meta(ge=0, le=10)] | None = None
    speckle_variance: Annotated[float, Meta(ge=0, le=1)] | None = None
    gaussian_variance: Annotated[float, Meta(ge=0, le=1)] | None = None
    bits: Annotated[int, Meta(ge=8, le=16)] | None = None
    shutter: Literal["global", "rolling"] = "global"
    readout_s: Annotated[float, Meta(ge=0, le=10)] = 0.0
    motion_blur: bool = True
    pixel_pitch_um: tuple[Pitch, Pitch] | None = None
    detector: DetectorSection | None = None
    binning: Annotated[int, Meta(ge=1, le=16)] = 1
    roi_px: tuple[int, int, int, int] | None = None
    auto_exposure: AutoExposure | None = None


class Output(Section, frozen=True, kw_only=True):
    """Bands and quality of the picture, and the label layers that a capture writes (``all`` for every one)."""

    bands: Bands = "mono"
    quality: Quality = "default"
    labels: tuple[Layer, ...] = ()
