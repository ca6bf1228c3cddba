"""Prefetch of the Earth's maps: decoded or read from the cache in threads, while the target is prepared."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flyaround.simulator.celestial.air_tables import COSINES, GROUND_SAMPLES, RADII, AirTables, air_tables
from flyaround.simulator.celestial.city_lights import night_texture
from flyaround.simulator.celestial.detail_noise import detail_texture
from flyaround.simulator.celestial.earth_albedo import albedo_of_day
from flyaround.simulator.celestial.earth_maps import packed_maps
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
_ODD, _EVEN = (6, 12), (4, 8)  # rows and columns of stand-ins: not powers of two, and powers of two
AUGUST = Season(8, 8, 0.0)  # month of the fine map


@dataclass(frozen=True, eq=False)
class EarthMaps:
    """Futures of maps and tables.

    Parameters
    ----------
    albedo : Future
        Albedo for Earth-shine.
    maps : Future
        Textures of the maps, one for one band, two for three.
    months : Future
        Gains by month number.
    ocean_colour : Future
        Map of the water's colour, uploaded once such water is in view.
    night : Future
        Map of the city lights, uploaded once the night side is in view.
    air : Future
        Tables for the scene's thickness.
    """

    albedo: Future[Float32Array]
    maps: Future[list[MipmapChain]]
    detail: Future[MipmapChain]
    ground_slopes: Future[MipmapChain]
    months: Future[dict[int, MipmapChain]]
    ocean_colour: Future[MipmapChain]
    night: Future[MipmapChain]
    air: Future[AirTables]


def prefetch_earth_maps(of_bands: Bands, environment: Environment, epoch_utc: str) -> EarthMaps:
    """Start decoding the maps that the Earth of a scene needs; NumPy and OpenCV release Python's lock.

    It can be called before the renderer exists that will draw the scene.
    """
    bands = 1 if of_bands == "mono" else 3
    dates = season(epoch_utc) if environment.seasons else AUGUST
    # longest tasks first: the detail alone takes as long as the maps
    pools = [ThreadPoolExecutor(1) for _ in range(min(helper_threads(), 2))]
    with_maps, other_pools = pools[0], pools[-1]
    maps = with_maps.submit(lambda: [mipmap_chain(image, globe=True) for image in packed_maps(bands)])
    albedo = with_maps.submit(albedo_of_day, epoch_utc, clouds=environment.clouds, ice=environment.sea_ice)
    months = with_maps.submit(_months, sorted({dates.before, dates.after}), bands)
    # needed by few scenes
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
            of_bands,
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


def prefetch_maps_of(first: SceneState | None) -> dict[Bands, EarthMaps]:
    """Return prefetched maps for the first scene, as `Renderer` takes them; none if it has no Earth."""
    if first is None or not shows_earth(first):
        return {}
    return {first.bands: prefetch_earth_maps(first.bands, first.environment, first.epoch_utc)}


def stand_ins(of_bands: Bands, environment: Environment, epoch_utc: str) -> EarthMaps:
    """Return black maps of a few texels, of the kinds that `prefetch_earth_maps` prepares, and air without light.

    A driver's programs depend on a texture's channels, levels, and whether its sides are powers of two.
    """
    bands = 1 if of_bands == "mono" else 3
    dates = season(epoch_utc) if environment.seasons else AUGUST
    many, one = _black(_ODD, 4), _black(_ODD, 1)
    month = _black(_EVEN, bands)
    air = earth_atmosphere(
        of_bands, environment.atmosphere_thickness_km * 1e3, environment.aerosol_optical_depth
    )
    tables = [
        np.zeros((*size, bands), np.float32)
        for size in ((RADII, COSINES), (GROUND_SAMPLES,), (HEIGHTS, SUNS))
    ]
    return EarthMaps(
        _done(np.zeros(0, np.float32)),
        _done([many] * (1 if bands == 1 else 2)),
        _done(_black(_EVEN, 4)),
        _done(many),
        _done({dates.before: month, dates.after: month}),
        _done(one if bands == 1 else many),
        _done(_black(_EVEN, 4)),
        _done(AirTables(air, *tables)),
    )


def _black(size: tuple[int, int], bands: int) -> MipmapChain:
    return mipmap_chain(np.zeros(size if bands == 1 else (*size, 4), np.uint8), globe=True)


def _done(value: _T) -> Future[_T]:
    future: Future[_T] = Future()
    future.set_result(value)
    return future


def _months(months: list[int], bands: int) -> dict[int, MipmapChain]:
    chains = (mipmap_chain(gain, globe=True) for gain in month_gains(months, bands))
    return dict(zip(months, chains, strict=True))
