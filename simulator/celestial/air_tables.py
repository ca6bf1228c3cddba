"""Static tables of the atmosphere, computed once in double precision and cached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.scene.illumination.atmosphere import (
    MultipleScattering,
    body_atmosphere,
    ground_irradiance,
    optical_depth_to_top,
)
from flyaround.simulator.scene.illumination.bands import bands_of
from flyaround.simulator.scene.illumination.multiple_scattering import multiple_scattering
from flyaround.simulator.world.bodies.earth import EARTH

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Float32Array
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.world.ephemeris.body import Body

RADII, COSINES = 64, 128  # axes of the transmittance table

# Number of cosines of the Sun's zenith angle in the table of ground light.
GROUND_SAMPLES = 512
GROUND_MU_MIN = -0.3  # no light reaches the ground when the Sun is lower than this


@dataclass(frozen=True, eq=False)
class AirTables:
    """Tables of one atmosphere, last axis the bands.

    Parameters
    ----------
    air : Atmosphere
        Atmosphere of the tables.
    transmittance : (RADII, COSINES, n) array
        Transmittance to the top of the atmosphere; mapping of Bruneton & Neyret (2008), section 4.
    ground : (GROUND_SAMPLES, n) array
        Direct plus diffuse irradiance on level ground, as a share of the Sun's irradiance.
    multiple : (HEIGHTS, SUNS, n) array
        Light scattered at least twice; see simulator/scene/illumination/multiple_scattering.py.
    """

    air: Atmosphere
    transmittance: Float32Array
    ground: Float32Array
    multiple: Float32Array


def air_tables(
    bands: Bands, thickness_m: float | None = None, body: Body = EARTH, aerosol_depth: float | None = None
) -> AirTables:
    """Return a body's tables for the camera's bands; the parameters are those of `body_atmosphere`.

    Returns
    -------
    AirTables
        Atmosphere, transmittance, irradiance on the ground and multiple scattering, float32, from the cache.
    """
    air = body_atmosphere(body, bands, thickness_m, aerosol_depth)
    makers = (transmittance_table, multiple_scattering, body_atmosphere, bands_of)

    def key(table: str) -> str:
        key_parts = repr(body.air), body.radius_m, body.albedo
        return entry_name(
            f"air-{table}-{bands}", makers, bands, float(air.thickness_m), air.aerosol_depth, *key_parts
        )

    multiple = cached_array(
        key("multiple"), lambda: multiple_scattering(air, body.albedo).psi.astype(np.float32)
    )
    scattered = MultipleScattering(np.asarray(multiple, float), air.thickness_m)
    return AirTables(
        air,
        cached_array(key("transmittance"), lambda: transmittance_table(air)),
        cached_array(key("ground"), lambda: _ground_table(air, scattered)),
        multiple,
    )


def transmittance_table(air: Atmosphere) -> Float32Array:
    """Return the transmittance to the top; rows: radius, columns: distance to the top between its limits."""
    rim = np.sqrt(air.top_m**2 - air.radius_m**2)
    rho = np.linspace(0, rim, RADII)[:, None]
    r = np.sqrt(rho**2 + air.radius_m**2)
    shortest, longest = air.top_m - r, rho + rim
    d = shortest + (longest - shortest) * np.linspace(0, 1, COSINES)[None, :]
    mu = np.where(d > 0, (air.top_m**2 - r * r - d * d) / (2 * r * np.maximum(d, 1e-3)), 1.0)
    depth = optical_depth_to_top(air, np.broadcast_to(r, mu.shape), np.clip(mu, -1, 1), steps=64)
    return np.exp(-depth).astype(np.float32)


def _ground_table(air: Atmosphere, multiple: MultipleScattering) -> Float32Array:
    nodes = np.concatenate([np.linspace(GROUND_MU_MIN, 0.1, 41), np.linspace(0.15, 1, 18)])
    _, diffuse = ground_irradiance(air, nodes, multiple=multiple)
    mu = np.linspace(GROUND_MU_MIN, 1, GROUND_SAMPLES)
    direct, _ = ground_irradiance(air, mu, diffuse=False)
    sky = np.stack([np.interp(mu, nodes, diffuse[:, k]) for k in range(diffuse.shape[1])], axis=1)
    total = direct + sky
    total[0] = 0.0  # lower Suns are clamped to this entry
    return total.astype(np.float32)
