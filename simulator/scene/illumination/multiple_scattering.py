"""Table of multiple scattering over height and the Sun's zenith angle, in double precision.

Light is scattered isotropically after the first scattering, as in Hillaire (2020), section 5.5. In contrast to that
method, which assumes a local geometric series, the orders are summed along the rays, including light from the ground.

References
----------
Hillaire (2020), A scalable and production ready sky and atmosphere rendering technique, Computer Graphics Forum 39(4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.atmosphere import (
    MultipleScattering,
    interpolate_table,
    mie_phase,
    optical_depth_to_top,
    rayleigh_phase,
    sun_column,
    sun_share,
)
from flyaround.simulator.world.bodies.earth import EARTH

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere

HEIGHTS, SUNS = 24, 33  # size of the table: heights, and elevations of the Sun
_STEPS = 16  # steps along a ray
_ORDERS = 12  # number of scattering orders: blue light over snow has then decayed to a thousandth
_POLAR, _TURNS = 8, 6  # directions of integration: polar and azimuth angles


def multiple_scattering(air: Atmosphere, ground_albedo: float = EARTH.albedo) -> MultipleScattering:
    """Compute the table of one atmosphere over ground of uniform albedo.

    Returns
    -------
    MultipleScattering
        Table (HEIGHTS, SUNS, n) of light scattered at least twice, by height and cosine of the Sun's zenith angle.
    """
    # the middle column is on the horizon
    column = np.linspace(-1, 1, SUNS)
    mu_sun = np.sign(column) * column**2
    # a metre above the ground and below the top, so that rays are unambiguous
    height = np.linspace(0, 1, HEIGHTS) ** 2 * air.thickness_m
    height = np.clip(height, 1.0, air.thickness_m - 1.0)
    rays, weight = _sphere()
    suns = np.stack([np.sqrt(1 - mu_sun**2), np.zeros_like(mu_sun), mu_sun], axis=1)
    paths = _paths(air, air.radius_m + height, rays, suns)
    return _higher_orders(paths, rays[:, 2], weight, air.thickness_m, ground_albedo)


def _sphere() -> tuple[FloatArray, FloatArray]:
    """Return directions (K, 3) over the whole sphere, and weights that sum to one."""
    nodes, weights = np.polynomial.legendre.leggauss(_POLAR)
    c, a = (v.ravel() for v in np.meshgrid(nodes, (np.arange(_TURNS) + 0.5) / _TURNS * np.pi, indexing="ij"))
    s = np.sqrt(1 - c * c)
    # the sky is symmetric about the Sun's vertical: half of the azimuths suffice
    return np.stack([s * np.cos(a), s * np.sin(a), c], axis=1), np.repeat(weights / 2, _TURNS) / _TURNS


class _SunTable:
    """Transmittance to the Sun from tabulated optical depths by height and cosine above the horizon, to 1e-3."""

    def __init__(self, air: Atmosphere) -> None:
        from scipy.interpolate import RegularGridInterpolator  # noqa: PLC0415 - slow to import

        self._air = air
        height, lift = np.linspace(0, 1, 40), np.linspace(0, 1, 60)
        r = air.radius_m + height[:, None] ** 2 * air.thickness_m
        horizon = self._horizon(r)
        mu = horizon + lift**2 * (1 - horizon)
        depth = optical_depth_to_top(air, np.broadcast_to(r, mu.shape), mu, steps=40)
        self._depth = RegularGridInterpolator((height, lift), depth)

    def _horizon(self, r: FloatArray) -> FloatArray:
        return -np.sqrt(np.clip(1 - (self._air.radius_m / r) ** 2, 0, None))

    def __call__(self, radius_m: FloatArray, mu_sun: FloatArray) -> FloatArray:
        r = np.clip(radius_m, self._air.radius_m, self._air.top_m)
        horizon = self._horizon(r)
        lift = np.sqrt(np.clip((mu_sun - horizon) / (1 - horizon), 0, 1))
        height = np.sqrt((r - self._air.radius_m) / self._air.thickness_m)
        depth = self._depth(np.stack([np.clip(height, 0, 1), lift], axis=-1))
        return np.asarray(np.exp(-depth) * sun_share(r, mu_sun, self._air.radius_m)[..., None])


@dataclass(frozen=True, eq=False)
class _Paths:
    """Rays from each of H heights in K directions, for S Suns: quantities for the radiance at their starts.

    Parameters
    ----------
    first : (H, K, S, n) array
        Radiance of single scattering.
    sunlit : (H, K, S, n) array
        Radiance of ground in direct sunlight.
    scattered : (STEPS, H, K, n) array
        Share of the mean radiance that each step scatters along the ray.
    row : (STEPS, H, K) array
        Row of each step in the table.
    column : (STEPS, H, K, S) array
        Column of each step in the table.
    white_ground : (H, K, n) array
        Radiance of white ground over its irradiance.
    ground_column : (H, K, S) array
        Column of the ground point in the table.
    """

    first: FloatArray
    sunlit: FloatArray
    scattered: FloatArray
    row: FloatArray
    column: FloatArray
    white_ground: FloatArray
    ground_column: FloatArray


def _paths(air: Atmosphere, radius_m: FloatArray, rays: FloatArray, suns: FloatArray) -> _Paths:
    """Integrate along the rays (K, 3) from radii (H,), for Suns (S, 3)."""
    sunlight = _SunTable(air)
    mu, radius = rays[:, 2], radius_m[:, None]
    to_top = -radius * mu + np.sqrt((radius * mu) ** 2 + air.top_m**2 - radius**2)
    discriminant = (radius * mu) ** 2 + air.radius_m**2 - radius**2
    hits_ground = (discriminant > 0) & (mu < 0)
    length = np.where(hits_ground, -radius * mu - np.sqrt(np.clip(discriminant, 0, None)), to_top)
    angle = rays @ suns.T
    phases = rayleigh_phase(angle)[..., None], mie_phase(angle, air.mie_g)[..., None]
    depth = np.zeros((*length.shape, len(air.rayleigh_m)))
    first = np.zeros((*length.shape, len(suns), len(air.rayleigh_m)))
    start = np.array([0.0, 0.0, 1.0]) * radius_m[:, None, None]
    steps = []
    for k in range(_STEPS):
        # dense near the start, where most of the light comes from
        edge0, edge1 = (k / _STEPS) ** 2, ((k + 1) / _STEPS) ** 2
        t, dt = 0.5 * (edge0 + edge1) * length, (edge1 - edge0) * length
        p = start + t[..., None] * rays
        r = np.linalg.norm(p, axis=-1)
        rayleigh, mie, _ = air.density(r - air.radius_m)
        extinction = air.extinction_m(r - air.radius_m)
        # analytic over the step: exact for uniform air of any thickness
        through = np.exp(-extinction * dt[..., None])
        arrives = np.exp(-depth) * (1 - through) / np.maximum(extinction, 1e-30)
        mu_sun = np.clip(p @ suns.T / r[..., None], -1, 1)
        light = sunlight(np.broadcast_to(r[..., None], mu_sun.shape), mu_sun)
        by_kind = rayleigh[..., None] * air.rayleigh_m, mie[..., None] * air.mie_scattering_m
        for kind, phase in zip(by_kind, phases, strict=True):
            first += (arrives * kind)[..., None, :] * light * phase
        height = np.clip((r - air.radius_m) / air.thickness_m, 0, 1)
        steps.append((arrives * sum(by_kind), np.sqrt(height), sun_column(mu_sun)))
        depth += extinction * dt[..., None]
    ground_point = start + length[..., None] * rays
    mu_sun = np.clip(ground_point @ suns.T / air.radius_m, -1, 1)
    white = np.where(hits_ground[..., None], np.exp(-depth) / np.pi, 0.0)
    direct = sunlight(np.full(mu_sun.shape, air.radius_m), mu_sun) * np.clip(mu_sun, 0, None)[..., None]
    scattered, row, column = (np.stack(part) for part in zip(*steps, strict=True))
    return _Paths(first, white[..., None, :] * direct, scattered, row, column, white, sun_column(mu_sun))


def _higher_orders(
    paths: _Paths, mu: FloatArray, weight: FloatArray, thickness_m: float, albedo: float
) -> MultipleScattering:
    """Sum the mean radiance of all higher orders; rays have zenith cosines ``mu``."""
    up = np.clip(mu, 0, None) * weight * 4 * np.pi
    total = paths.first + albedo * paths.sunlit
    light = total
    for _ in range(_ORDERS):
        psi = np.stack([np.einsum("k,ksn->sn", weight, order) for order in light])
        ground_flux = np.einsum("k,ksn->sn", up, light[0])[None]  # irradiance on the ground
        more = np.zeros_like(total)
        for scattered, row, column in zip(paths.scattered, paths.row, paths.column, strict=True):
            more += scattered[:, :, None] * interpolate_table(psi, row[..., None], column)
        ground = interpolate_table(ground_flux, np.zeros_like(paths.ground_column), paths.ground_column)
        light = total + more + albedo * paths.white_ground[:, :, None] * ground
    return MultipleScattering(psi, thickness_m)
