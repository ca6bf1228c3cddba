"""What the Earth is drawn from, decoded or fetched from the cache on threads while the target is prepared."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simulator.render.airtables import air_tables
from simulator.render.levels import levelled
from simulator.render.maps import KeptFiles, packed_maps
from simulator.render.noise import detail_texture
from simulator.render.seasons import Season, month_gain, relief, season
from simulator.render.shoals import shoals
from simulator.render.skylight import albedo_of_day

if TYPE_CHECKING:
    from concurrent.futures import Future

    from simulator.arrays import Float32Array
    from simulator.render.airtables import AirTables
    from simulator.render.levels import Levelled
    from simulator.scene.state import Bands, Environment

AUGUST = Season(8, 8, 0.0)  # the month of the fine map


@dataclass(frozen=True, eq=False)
class EarthMaps:
    """Pictures and tables under way; ``result()`` of each waits for it.

    Parameters
    ----------
    albedo : that the Earth-shine looks up. maps : one for one band, two for three. months : by number.
    shoals : uploaded only when such water is in view. air : of the scene's thickness.
    """

    albedo: Future[Float32Array]
    maps: Future[list[Levelled]]
    detail: Future[Levelled]
    relief: Future[Levelled]
    months: dict[int, Future[Levelled]]
    shoals: Future[Levelled]
    air: Future[AirTables]


def begin_earth_maps(of_bands: Bands, environment: Environment, epoch_utc: str) -> EarthMaps:
    """Start on what a scene's Earth needs, and return at once; NumPy and OpenCV leave Python free meanwhile.

    Before there is a scene it may be called for the sake of the cache alone: who asks again waits for what was begun.
    """
    bands = 1 if of_bands == "mono" else 3
    dates = season(epoch_utc) if environment.seasons else AUGUST
    # what takes longest first: the detail alone is as long as the maps
    with_maps, others = ThreadPoolExecutor(1), ThreadPoolExecutor(1)
    # the shallows before the maps: what is decoded for both is not kept any longer than for the maps alone
    files = KeptFiles()
    water = with_maps.submit(lambda: levelled(shoals(bands, files)))
    maps = with_maps.submit(lambda: [levelled(image) for image in packed_maps(bands, files)])
    albedo = with_maps.submit(albedo_of_day, epoch_utc, clouds=environment.clouds, ice=environment.sea_ice)
    months = {month: with_maps.submit(_month, month, bands) for month in {dates.before, dates.after}}
    begun = EarthMaps(
        albedo,
        maps,
        others.submit(lambda: levelled(detail_texture())),
        others.submit(lambda: levelled(relief())),
        months,
        water,
        others.submit(air_tables, of_bands, environment.atmosphere_thickness_km * 1e3),
    )
    for pool in (with_maps, others):
        pool.shutdown(wait=False)
    return begun


def _month(month: int, bands: int) -> Levelled:
    return levelled(month_gain(month, bands))
