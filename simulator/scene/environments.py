"""Environments: the layers of the world to draw, and named presets of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, get_args

import msgspec
from msgspec import Meta

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.world.ephemeris.body import Body

EnvironmentName = Literal["full", "thesis", "undifferentiated", "airless", "space"]


class Environment(msgspec.Struct, frozen=True, kw_only=True):
    """The layers of the world to draw. Each Earth layer has its own optics and its own switch.

    Attributes
    ----------
    earth : bool
        The Earth.
    clouds : bool
        Clouds.
    ocean_glint : bool
        Reflection of the Sun in the sea.
    night_lights : bool
        Lights of cities on the night side.
    atmosphere : bool
        Scattering and absorption by the air.
    airglow : bool
        Emission of the air at 85 to 100 km, visible at night.
    stars : bool
        Stars.
    sun : bool
        The Sun's disc.
    sunlight : bool
        The Sun lights the target; if False it lights only the background, as in front of a laboratory's screen.
    earthshine : bool
        Light of bodies on the target.
    moon : bool
        The Moon, and bodies other than the Earth.
    planets : bool
        Planets, as points of light.
    seasons : bool
        Land and ice of the date, otherwise of August.
    relief : bool
        Shading of mountains.
    sea_ice : bool
        Climatological ice.
    undifferentiated : bool
        Land, sea and clouds reflect alike, as on a plain globe.
    atmosphere_thickness_km : float
        Height of the top of the atmosphere.
    aerosol_optical_depth : float
        Vertical, at 550 nm: 0.05 over clear seas, 0.1 to 0.3 over most land.
    """

    earth: bool = True
    clouds: bool = True
    ocean_glint: bool = True
    night_lights: bool = True
    atmosphere: bool = True
    airglow: bool = True
    stars: bool = True
    sun: bool = True
    sunlight: bool = True
    earthshine: bool = True
    moon: bool = True
    planets: bool = True
    seasons: bool = True
    relief: bool = True
    sea_ice: bool = True
    undifferentiated: bool = False
    atmosphere_thickness_km: Annotated[float, Meta(ge=5, le=200)] = 100.0
    aerosol_optical_depth: Annotated[float, Meta(ge=0, le=1)] = 0.05

    def draws(self, body: Body) -> bool:
        """Return True if the switch of a body is on.

        Returns
        -------
        bool
            True if the body is drawn.
        """
        return bool(getattr(self, body.layer))


class EnvironmentSection(Environment, frozen=True, forbid_unknown_fields=True):
    """The layers of the world to draw: those of ``preset``, unless a key of the file overrides them."""

    preset: EnvironmentName = "full"

    def layers(self) -> Environment:
        """Return the layers without the preset's name.

        Returns
        -------
        Environment
            Switches and parameters of this section; the reader of the file has already applied the preset.
        """
        return Environment(**{name: getattr(self, name) for name in Environment.__struct_fields__})


_FULL = Environment()

NOTHING = Environment(
    earth=False,
    clouds=False,
    ocean_glint=False,
    night_lights=False,
    atmosphere=False,
    airglow=False,
    stars=False,
    sun=False,
    earthshine=False,
    moon=False,
    planets=False,
    sea_ice=False,
)
"""No body, no light but the Sun's: a base for `msgspec.structs.replace`."""

ENVIRONMENTS: dict[EnvironmentName, Environment] = {
    "full": _FULL,
    # the atmosphere of the Milan thesis ends at 25 km
    "thesis": msgspec.structs.replace(_FULL, atmosphere_thickness_km=25.0),
    # its counter-example: equal reflection of land, sea and clouds
    "undifferentiated": msgspec.structs.replace(_FULL, undifferentiated=True),
    "airless": msgspec.structs.replace(_FULL, atmosphere=False),
    # black background, and no light from the Earth on the target
    "space": msgspec.structs.replace(_FULL, earth=False, earthshine=False, moon=False),
}


def environment_preset(name: str) -> Environment:
    """Return the environment called ``name``.

    Returns
    -------
    Environment
        Layers of the preset, from `ENVIRONMENTS`.

    Raises
    ------
    UserError
        If there is none.
    """
    for preset, environment in ENVIRONMENTS.items():
        if preset == name:
            return environment
    raise UserError(
        f"unknown environment '{name}'; choose from {', '.join(get_args(EnvironmentName))}, "
        "or set its layers in a scenario's [environment]"
    )


def environment_section(name: str) -> EnvironmentSection:
    """Return the section of a named environment.

    Returns
    -------
    EnvironmentSection
        Section with ``preset`` set to the name and every layer set to its value in that preset.

    Raises
    ------
    UserError
        If there is none.
    """
    return msgspec.convert(
        {"preset": name, **msgspec.structs.asdict(environment_preset(name))}, EnvironmentSection
    )
