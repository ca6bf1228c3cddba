"""Rows of the rendering page on the Earth's surfaces above the air: daylit kinds, and city lights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import place_itrs_m, scene_above
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.constants import AU_M
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import Quality, SceneState

SUN_DEG = (20.0, 45.0, 65.0)
"""Zenith angle of the Sun."""
SIZE_PX = 64  # side of the image
_HEIGHT_KM = 700.0  # altitude of the camera
_CLEAR = Environment(clouds=False, stars=False, planets=False, moon=False)
NOTES = """
From straight above: mean of the drawn radiance times pi over the Sun's irradiance on level ground, 450-750 nm.
Desert: Libya 4, the mean of years of MODIS and OLI at the top of the air, 0.24, 0.34 and 0.45 in blue, green and red
(Mishra et al. 2014, Remote Sensing 6, 1327). Snow: albedo 0.97 in the visible (Warren 1982; Grenfell, Warren & Mullen
1994) and its anisotropy from straight above (Hudson et al. 2006; higher Suns: Dumont et al. 2010, ACP 10, 2507).
Forest: 0.025, 0.05 and 0.03 in blue, green and red (MODIS MCD43, evergreen broadleaf). Sea: clear water (Morel &
Maritorena 2001) and the glint of 6 m/s (Cox & Munk 1954). Cloud: optical depth 100, asymmetry 0.85; deep convective
clouds are as bright (Doelling et al. 2013). The last four, and the air above them, by PythonicDISORT 1.8, Rayleigh
0.085, aerosol 0.05, ozone 0.022. City lights: 25 to 60 is our reading of maps of Suomi NPP's day-night band (Elvidge
et al. 2017) around large cities, 50 km wide, clear and moonless; no table of such means is known to us.
"""


@dataclass(frozen=True)
class Kind:
    """A kind of surface: its position, and its reflectance above the atmosphere at `SUN_DEG`."""

    name: str
    place: tuple[float, float]
    epoch: str
    published: tuple[float, float, float]
    environment: Environment = _CLEAR


KINDS = (
    Kind("desert (Libya 4)", (28.55, 23.39), "2026-08-15T10:00:00Z", (0.385, 0.38, 0.37)),
    Kind("snow (Dome C)", (-75.1, 123.4), "2026-12-15T04:00:00Z", (0.93, 0.90, 0.84)),
    Kind("forest (Amazon)", (-3.0, -66.0), "2026-08-15T16:00:00Z", (0.062, 0.064, 0.074)),
    Kind("open sea (South Pacific)", (-25.0, -115.0), "2026-08-15T19:00:00Z", (0.105, 0.057, 0.066)),
    Kind(
        "thick cloud",
        (11.41, -167.79),
        "2026-08-15T23:00:00Z",
        (0.95, 0.92, 0.82),
        Environment(stars=False, planets=False, moon=False),
    ),
)
CITIES = {
    "Paris": (48.86, 2.35),
    "London": (51.5, -0.12),
    "New York": (40.75, -73.95),
    "Cairo": (30.05, 31.25),
}
"""Latitude and longitude of cities [deg]."""


def camera(width_km: float, size_px: int = SIZE_PX) -> Camera:
    """Return a square camera whose image covers ``width_km`` of the ground below it."""
    f, middle = size_px * _HEIGHT_KM / width_km, (size_px - 1) / 2
    return Camera(width_px=size_px, height_px=size_px, fx_px=f, fy_px=f, cx_px=middle, cy_px=middle)


def scene_under(
    place: tuple[float, float],
    epoch: str,
    sun_deg: float,
    environment: Environment,
    *,
    width_km: float = 60.0,
    bands: Bands = "mono",
    quality: Quality = "default",
) -> SceneState:
    """Return the nadir view of a place, with the Sun in the south-east ``sun_deg`` from its zenith."""
    ref = TargetRef(name="tango", sha256=load_target("tango").sha256)
    scene = scene_above(
        epoch,
        (*place, _HEIGHT_KM),
        camera=camera(width_km),
        target=ref,
        bands=bands,
        quality=quality,
        environment=environment,
    )
    east, north, up = place_itrs_m(*place, 0.0)[1] @ scene.body("earth").R_fixed_from_eci
    z = np.radians(sun_deg)
    sun = np.cos(z) * up + np.sin(z) * (east - north) / np.sqrt(2)
    return replace(scene, r_sun_eci_m=vec3(AU_M * sun))


def reflectance(
    renderer: Renderer, kind: Kind, sun_deg: float, *, bands: Bands = "mono", quality: Quality = "default"
) -> list[float]:
    """Return the mean reflectance of a kind of surface above the atmosphere, per band."""
    scene = scene_under(kind.place, kind.epoch, sun_deg, kind.environment, bands=bands, quality=quality)
    light = np.asarray(renderer.render(scene, load_target("tango")).radiance, float).reshape(SIZE_PX**2, -1)
    falling = sun_irradiance_w_m2(bands, AU_M) * np.cos(np.radians(sun_deg))
    return [float(x) for x in np.pi * light.mean(axis=0) / falling]


def city_radiance(
    renderer: Renderer, place: tuple[float, float], width_km: float = 50.0, *, quality: Quality = "default"
) -> float:
    """Return the mean radiance around a city at night [nW cm-2 sr-1]."""
    scene = scene_under(place, "2026-08-15T00:00:00Z", 150.0, _CLEAR, width_km=width_km, quality=quality)
    return float(np.mean(renderer.render(scene, load_target("tango")).radiance)) * 1e5


def rows(renderer: Renderer) -> list[Row]:
    """Measure and return every comparison."""
    out = []
    for kind in KINDS:
        for sun_deg, published in zip(SUN_DEG, kind.published, strict=True):
            drawn = reflectance(renderer, kind, sun_deg)[0]
            out.append(
                Row(
                    what=f"{kind.name}, Sun {sun_deg:g} deg from the zenith: {drawn:.3f}, relative",
                    against=f"{published:g}",
                    unit="1",
                    goal=0.10,
                    measured=abs(drawn / published - 1),
                )
            )
    for name, place in CITIES.items():
        mean = city_radiance(renderer, place)
        out.append(
            Row(
                what=f"lights of {name} over 50 km: {mean:.0f} nW cm-2 sr-1, distance from 25 to 60",
                against="VIIRS",
                unit="nW cm-2 sr-1",
                goal=5.0,
                measured=max(25.0 - mean, mean - 60.0, 0.0),
            )
        )
    return out
