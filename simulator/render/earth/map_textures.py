"""Prefetch of the Earth's maps. Threads decode them, or read them from the cache, while the target is prepared."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flyaround.simulator.celestial.air_tables import COSINES, GROUND_SAMPLES, RADII, AirTables, air_tables
from flyaround.simulator.celestial.city_lights import night_texture
from flyaround.simulator.celestial.detail_noise import detail_texture
from flyaround.simulator.celestial.earth_albedo import albedo_of_day
from flyaround.simulator.celestial.earth_maps import LIGHTS_CHANNEL, packed_maps
from flyaround.simulator.celestial.ocean_colour import ocean_colour
from flyaround.simulator.celestial.seasons import Season, ground_slopes, month_gains, season
from flyaround.simulator.render.gl.mipmaps import mipmap_chain
from flyaround.simulator.runtime.progress import watch_steps
from flyaround.simulator.runtime.threads import helper_threads
from flyaround.simulator.scene.illumination.atmosphere import earth_atmosphere
from flyaround.simulator.scene.illumination.multiple_scattering import HEIGHTS, SUNS

if TYPE_CHECKING:
    from flyaround.simulator.render.gl.mipmaps import MipmapChain
    from flyaround.simulator.runtime.arrays import Float32Array
    from flyaround.simulator.scene.environments import Environment
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState

_T = TypeVar("_T")
# rows and columns of placeholders: not powers of two, and powers of two
_SIZE_NPOT, _SIZE_POT = (6, 12), (4, 8)
AUGUST = Season(8, 8, 0.0)
"""Season of the finest map, which is drawn unchanged in August."""


@dataclass(frozen=True, eq=False)
class EarthMaps:
    """Futures of maps and tables.

    Parameters
    ----------
    albedo : Future
        Albedo of the globe, for Earth-shine.
    maps : Future
        Textures of the maps, one for one band, two for three.
    detail : Future
        Tiling texture of ground and clouds below the maps' resolution.
    ground_slopes : Future
        Slopes of the terrain.
    months : Future
        Gains over the August map, by month number.
    ocean_colour : Future
        Map of the water's colour, uploaded once such water is in view.
    night : Future
        Map of the city lights, uploaded once the night side is in view.
    air : Future
        Tables of the air, for the scene's thickness and aerosols.
    """

    albedo: Future[Float32Array]
    maps: Future[list[MipmapChain]]
    detail: Future[MipmapChain]
    ground_slopes: Future[MipmapChain]
    months: Future[dict[int, MipmapChain]]
    ocean_colour: Future[MipmapChain]
    night: Future[MipmapChain]
    air: Future[AirTables]


def prefetch_earth_maps(bands_name: Bands, environment: Environment, epoch_utc: str) -> EarthMaps:
    """Start decoding the maps that the Earth of a scene needs, on other threads.

    It may be called before the renderer exists.

    Returns
    -------
    EarthMaps
        Futures for a renderer of these bands and this environment; an error of decoding is raised by their ``result``.
    """
    bands = 1 if bands_name == "mono" else 3
    dates = season(epoch_utc) if environment.seasons else AUGUST
    # longest tasks first: the detail texture alone takes as long as the maps
    pools = [ThreadPoolExecutor(1) for _ in range(min(helper_threads(), 2))]
    with_maps, other_pools = pools[0], pools[-1]
    maps = with_maps.submit(_map_chains, bands)
    albedo = with_maps.submit(albedo_of_day, epoch_utc, clouds=environment.clouds, ice=environment.sea_ice)
    months = with_maps.submit(_months, sorted({dates.before, dates.after}), bands)
    # last, because few scenes need it
    water = with_maps.submit(lambda: mipmap_chain(ocean_colour(bands), globe=True))
    prefetched = EarthMaps(
        albedo,
        maps,
        other_pools.submit(lambda: mipmap_chain(detail_texture(), globe=False)),
        other_pools.submit(lambda: mipmap_chain(ground_slopes(), globe=True)),
        months,
        water,
        with_maps.submit(lambda: mipmap_chain(night_texture(), globe=False)),
        other_pools.submit(
            air_tables,
            bands_name,
            environment.atmosphere_thickness_km * 1e3,
            aerosol_depth=environment.aerosol_optical_depth,
        ),
    )
    watch_steps(
        {
            "maps of the Earth": prefetched.maps,
            "terrain": prefetched.detail,
            "albedo": prefetched.albedo,
            "relief": prefetched.ground_slopes,
            "seasons": prefetched.months,
            "air": prefetched.air,
        }
    )
    for pool in pools:
        pool.shutdown(wait=False)
    return prefetched


def shows_earth(scene: SceneState) -> bool:
    """Return True if a scene's globe is the Earth, and drawn."""
    body = scene.globe.body
    return body.surface == "earth" and scene.environment.draws(body)


def prefetch_maps(first: SceneState | None) -> dict[Bands, EarthMaps]:
    """Start decoding the maps of the first scene.

    Returns
    -------
    dict of str to EarthMaps
        Futures by bands, as `Renderer` takes them; empty without a scene or the Earth.
    """
    if first is None or not shows_earth(first):
        return {}
    return {first.bands: prefetch_earth_maps(first.bands, first.environment, first.epoch_utc)}


def placeholder_maps(bands_name: Bands, environment: Environment, epoch_utc: str) -> EarthMaps:
    """Return black placeholder maps of a few texels, and air without light, for compiling programs.

    A driver compiles programs for a texture's channels and levels, and for sides that are or are not powers of two. The
    placeholders have the properties of the maps that `prefetch_earth_maps` prepares.
    """
    bands = 1 if bands_name == "mono" else 3
    dates = season(epoch_utc) if environment.seasons else AUGUST
    colour, gray = _black(_SIZE_NPOT, 4), _black(_SIZE_NPOT, 1)
    month = _black(_SIZE_POT, bands)
    air = earth_atmosphere(
        bands_name, environment.atmosphere_thickness_km * 1e3, environment.aerosol_optical_depth
    )
    tables = [
        np.zeros((*size, bands), np.float32)
        for size in ((RADII, COSINES), (GROUND_SAMPLES,), (HEIGHTS, SUNS))
    ]
    return EarthMaps(
        _completed(np.zeros(0, np.float32)),
        _completed([colour] * (1 if bands == 1 else 2)),
        _completed(_black(_SIZE_POT, 4)),
        _completed(colour),
        _completed({dates.before: month, dates.after: month}),
        _completed(gray if bands == 1 else colour),
        _completed(_black(_SIZE_POT, 4)),
        _completed(AirTables(air, *tables)),
    )


def _black(size: tuple[int, int], bands: int) -> MipmapChain:
    return mipmap_chain(np.zeros(size if bands == 1 else (*size, 4), np.uint8), globe=True)


def _completed(value: _T) -> Future[_T]:
    future: Future[_T] = Future()
    future.set_result(value)
    return future


def _map_chains(bands: int) -> list[MipmapChain]:
    """Return the maps with their levels; the first map's lights are square roots."""
    first, *others = packed_maps(bands)
    return [
        mipmap_chain(first, globe=True, root_channel=LIGHTS_CHANNEL),
        *(mipmap_chain(image, globe=True) for image in others),
    ]


def _months(months: list[int], bands: int) -> dict[int, MipmapChain]:
    chains = (mipmap_chain(gain, globe=True) for gain in month_gains(months, bands))
    return dict(zip(months, chains, strict=True))
