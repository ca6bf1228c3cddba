"""The file of --vary, and a recipe's section [vary]: ranges within which frames are varied."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from flyaround.simulator.runtime.sections import Interval, Section
from flyaround.simulator.scene.environments import EnvironmentName
from flyaround.simulator.scene.illumination.area_light import DIFFUSE_DEG, MAX_LIGHTS

Factors = Interval[Annotated[float, Meta(ge=0.01, le=100)]]
_Positive = Annotated[float, Meta(gt=0, le=1e6)]


class VaryCraft(Section, frozen=True, kw_only=True):
    """Variation of the craft. It changes only ``every`` few frames, because baking a mesh takes seconds.

    ``reflectance`` and ``roughness`` are factors drawn for each material. ``model_error_mm``: the craft is stretched
    and sheared so that the largest displacement of a vertex equals a value drawn from this range.
    """

    every: Annotated[int, Meta(ge=1, le=1_000_000)] = 50
    reflectance: Factors = (1.0, 1.0)
    roughness: Factors = (1.0, 1.0)
    model_error_mm: Interval[Annotated[float, Meta(ge=0, le=1000)]] = (0.0, 0.0)


class VaryLights(Section, frozen=True, kw_only=True):
    """Shares of frames with a lamp on the chaser and with Earth-shine, and ranges of the lamp's power and half
    angle.
    """

    lamp_share: Annotated[float, Meta(ge=0, le=1)] = 0.0
    lamp_power_w: Interval[_Positive] = (10.0, 100.0)
    lamp_half_angle_deg: Interval[Annotated[float, Meta(ge=0.5, le=80)]] = (10.0, 40.0)
    earthshine_share: Annotated[float, Meta(ge=0, le=1)] = 1.0


class VaryBoxes(Section, frozen=True, kw_only=True):
    """Area lights near the craft instead of the scene's own: number, position, size, radiance.

    Each light is at ``distance_m`` from the target's origin, in a direction within ``max_angle_deg`` of that to the
    camera, uniform in solid angle. It is aimed at a point within ``aim_error_m`` of the origin. Width and height are
    drawn independently; radiance is uniform in its logarithm. A ``half_angle_deg`` of 60 is a diffuse box, a smaller
    one a lamp.
    """

    count: Interval[Annotated[int, Meta(ge=0, le=MAX_LIGHTS)]] = (1, 3)
    distance_m: Interval[_Positive] = (1.5, 4.0)
    max_angle_deg: Annotated[float, Meta(ge=1, le=180)] = 150.0
    size_m: Interval[Annotated[float, Meta(ge=0.01, le=100)]] = (0.4, 1.5)
    radiance_w_m2_sr: Interval[_Positive] = (100.0, 1000.0)
    half_angle_deg: Interval[Annotated[float, Meta(ge=1, le=60)]] = (DIFFUSE_DEG, DIFFUSE_DEG)
    aim_error_m: Annotated[float, Meta(ge=0, le=100)] = 0.3


class VaryImage(Section, frozen=True, kw_only=True):
    """Ranges of factors on exposure and noise, of PSF width, of a detector's black level, and of glow.

    The factors and ``glow_share`` are uniform in the logarithm, the other quantities uniform.
    """

    exposure: Factors = (1.0, 1.0)
    noise: Factors = (1.0, 1.0)
    psf_sigma_px: Interval[Annotated[float, Meta(ge=0, le=10)]] | None = None
    pedestal_dn: Interval[Annotated[float, Meta(ge=0, le=60_000)]] | None = None
    glow_share: Interval[Annotated[float, Meta(ge=1e-6, le=0.5)]] | None = None
    glow_radius_px: Interval[Annotated[float, Meta(ge=2, le=500)]] = (10.0, 40.0)


class VaryBackground(Section, frozen=True, kw_only=True):
    """Environments from which each frame's is drawn."""

    environments: Annotated[list[EnvironmentName], Meta(min_length=1, max_length=20)]


class Vary(Section, frozen=True, kw_only=True):
    """Ranges within which each frame is varied; a missing section varies nothing."""

    schema: Literal["flyaround.vary"] = "flyaround.vary"
    version: Literal[1] = 1
    craft: VaryCraft | None = None
    lights: VaryLights | None = None
    boxes: VaryBoxes | None = None
    image: VaryImage | None = None
    background: VaryBackground | None = None
