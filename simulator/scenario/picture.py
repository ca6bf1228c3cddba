"""The tables of a scenario file that say what the picture is: sensor, environment, lamp, output."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from simulator.camera.sections import DetectorSection
from simulator.runtime.sections import MetresXyz, Section
from simulator.scene.environments import EnvironmentName, environment_preset
from simulator.scene.illumination.lamp import Profile
from simulator.scene.state import Bands, Quality

Pitch = Annotated[float, Meta(gt=0.1, le=1000)]
Layer = Literal["all", "amodal", "parts", "depth", "normals", "flow", "clean", "wireframe"]


class AutoExposureSection(Section, frozen=True, kw_only=True):
    """With this section the exposure follows what the camera sees, with lag; ``exposure_s`` is not used.

    ``level``: signal, 1 at full scale, that ``share`` of what is lit on the image stays below.
    """

    level: Annotated[float, Meta(gt=0, le=1)] = 0.5
    share: Annotated[float, Meta(gt=0, le=1)] = 0.9
    lag_s: Annotated[float, Meta(ge=0.01, le=600)] = 2.0
    shortest_s: Annotated[float, Meta(gt=0, le=10)] = 1e-5
    longest_s: Annotated[float, Meta(gt=0, le=10)] = 0.1


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
    auto_exposure: AutoExposureSection | None = None


class EnvironmentSection(Section, frozen=True, kw_only=True):
    """Which layers of the world are drawn: those of ``preset``, except where a key of the file says otherwise."""

    preset: EnvironmentName = "full"
    earth: bool = True
    clouds: bool = True
    ocean_glint: bool = True
    night_lights: bool = True
    atmosphere: bool = True
    stars: bool = True
    sun: bool = True
    earthshine: bool = True
    moon: bool = True
    planets: bool = True
    seasons: bool = True
    relief: bool = True
    sea_ice: bool = True
    undifferentiated: bool = False
    atmosphere_thickness_km: Annotated[float, Meta(ge=5, le=200)] = 100.0


def environment_section(name: str) -> EnvironmentSection:
    """The section of a named environment, every layer as it has it.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    return msgspec.convert({"preset": name, **asdict(environment_preset(name))}, EnvironmentSection)


class LampSection(Section, frozen=True, kw_only=True):
    """With this section the chaser carries a lit lamp that shines along the camera's boresight.

    ``power_w`` is of the whole beam in the panchromatic band; the intensity falls to half at ``half_angle_deg`` (a
    ``flat`` beam ends there). ``offset_m`` is its place right of, below and before the camera; it throws no shadows.
    """

    power_w: Annotated[float, Meta(gt=0, le=1e6)]
    half_angle_deg: Annotated[float, Meta(ge=0.5, le=80)] = 20.0
    profile: Profile = "led"
    offset_m: MetresXyz = (0.0, 0.0, 0.0)


class Output(Section, frozen=True, kw_only=True):
    """Bands and quality of the picture, and the label layers that a capture writes (``all`` for every one)."""

    bands: Bands = "mono"
    quality: Quality = "default"
    labels: tuple[Layer, ...] = ()
