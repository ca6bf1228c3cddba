"""The file of --vary, and a recipe's section [vary]: ranges out of which frames are varied."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.runtime.toml_file import MOST_TOML_BYTES
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.runtime.validation_errors import explain
from flyaround.simulator.scenario.load import toml_table
from flyaround.simulator.scene.environments import EnvironmentName
from flyaround.simulator.scene.illumination.area_light import DIFFUSE_DEG, MOST_LIGHTS

Factors = tuple[Annotated[float, Meta(ge=0.01, le=100)], Annotated[float, Meta(ge=0.01, le=100)]]

_Positive = Annotated[float, Meta(gt=0, le=1e6)]
_LightSide = Annotated[float, Meta(ge=0.01, le=100)]
_HalfAngle = Annotated[float, Meta(ge=1, le=60)]
_GlowShare = Annotated[float, Meta(ge=1e-6, le=0.5)]


class VaryCraft(Section, frozen=True, kw_only=True):
    """The craft itself, another one every so many frames: what is worked out of a mesh takes seconds each.

    ``reflectance`` and ``roughness`` are factors of each material on its own. ``model_error_mm``: the craft is
    stretched and sheared until one of its vertices has moved by as much, a number out of this range.
    """

    every: Annotated[int, Meta(ge=1, le=1_000_000)] = 50
    reflectance: Factors = (1.0, 1.0)
    roughness: Factors = (1.0, 1.0)
    model_error_mm: tuple[Annotated[float, Meta(ge=0, le=1000)], Annotated[float, Meta(ge=0, le=1000)]] = (
        0.0,
        0.0,
    )


class VaryLights(Section, frozen=True, kw_only=True):
    """A lamp on the chaser in a share of frames, of a power and a half angle; light from the Earth in a share."""

    lamp_share: Annotated[float, Meta(ge=0, le=1)] = 0.0
    lamp_power_w: tuple[Annotated[float, Meta(gt=0, le=1e6)], Annotated[float, Meta(gt=0, le=1e6)]] = (
        10.0,
        100.0,
    )
    lamp_half_angle_deg: tuple[
        Annotated[float, Meta(ge=0.5, le=80)], Annotated[float, Meta(ge=0.5, le=80)]
    ] = (
        10.0,
        40.0,
    )
    earthshine_share: Annotated[float, Meta(ge=0, le=1)] = 1.0


class VaryBoxes(Section, frozen=True, kw_only=True):
    """Area lights about the craft instead of the scene's own: how many, where, how large, how bright.

    Each is at ``distance_m`` from the target's origin, in a direction within ``max_angle_deg`` of that to the camera,
    uniform in solid angle, and shines at a place within ``aim_error_m`` of it. Sides are drawn one by one; radiance is
    uniform in its logarithm; ``half_angle_deg`` of 60 is a diffuse box, less a lamp.
    """

    count: tuple[Annotated[int, Meta(ge=0, le=MOST_LIGHTS)], Annotated[int, Meta(ge=0, le=MOST_LIGHTS)]] = (
        1,
        3,
    )
    distance_m: tuple[_Positive, _Positive] = (1.5, 4.0)
    max_angle_deg: Annotated[float, Meta(ge=1, le=180)] = 150.0
    size_m: tuple[_LightSide, _LightSide] = (0.4, 1.5)
    radiance_w_m2_sr: tuple[_Positive, _Positive] = (100.0, 1000.0)
    half_angle_deg: tuple[_HalfAngle, _HalfAngle] = (DIFFUSE_DEG, DIFFUSE_DEG)
    aim_error_m: Annotated[float, Meta(ge=0, le=100)] = 0.3


class VaryImage(Section, frozen=True, kw_only=True):
    """Exposure and noise by factors, uniform in their logarithm; width of the PSF; a detector's black level; glow.

    ``glow_share`` is uniform in its logarithm, ``glow_radius_px`` uniform.
    """

    exposure: Factors = (1.0, 1.0)
    noise: Factors = (1.0, 1.0)
    psf_sigma_px: tuple[Annotated[float, Meta(ge=0, le=10)], Annotated[float, Meta(ge=0, le=10)]] | None = (
        None
    )
    pedestal_dn: (
        tuple[Annotated[float, Meta(ge=0, le=60_000)], Annotated[float, Meta(ge=0, le=60_000)]] | None
    ) = None
    glow_share: tuple[_GlowShare, _GlowShare] | None = None
    glow_radius_px: tuple[Annotated[float, Meta(ge=2, le=500)], Annotated[float, Meta(ge=2, le=500)]] = (
        10.0,
        40.0,
    )


class VaryBackground(Section, frozen=True, kw_only=True):
    """One of these environments for each frame."""

    environments: Annotated[list[EnvironmentName], Meta(min_length=1, max_length=20)]


class Vary(Section, frozen=True, kw_only=True):
    """Ranges out of which each frame is varied; what has no section stays as it is."""

    schema: Literal["flyaround.vary"] = "flyaround.vary"
    version: Literal[1] = 1
    craft: VaryCraft | None = None
    lights: VaryLights | None = None
    boxes: VaryBoxes | None = None
    image: VaryImage | None = None
    background: VaryBackground | None = None


def load_vary(path: str | Path) -> Vary:
    """The ranges of a TOML file.

    Raises
    ------
    UserError
        If it cannot be read, or has a mistake: key, value given and what is allowed.
    """
    where = str(path)
    try:
        raw = toml_table(read_regular(Path(path), MOST_TOML_BYTES), where)
    except OSError as error:
        raise UserError(
            f"--vary {where} cannot be read: {error.strerror or error}; give a TOML file of ranges"
        ) from error
    try:
        vary = msgspec.convert(raw, Vary)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {explain(str(error), raw, Vary)}") from error
    check_vary(vary, where)
    return vary


def check_vary(vary: Vary, where: str) -> None:
    """Refuse ranges whose ends are exchanged.

    Raises
    ------
    UserError
        With the key, its values and what to do.
    """
    for name in ("craft", "lights", "boxes", "image"):
        section = getattr(vary, name)
        for key, value in () if section is None else msgspec.structs.asdict(section).items():
            if isinstance(value, tuple) and value[0] > value[1]:
                raise UserError(
                    f"{where}: key {name}.{key} is [{value[0]:g}, {value[1]:g}], allowed: the smaller first"
                )


def vary_json_schema() -> dict[str, Any]:
    """JSON Schema of the file."""
    return msgspec.json.schema(Vary)
