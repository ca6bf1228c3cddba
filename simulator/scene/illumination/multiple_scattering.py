"""Light scattered twice or more: the table of Hillaire (2020), in double precision.

Every order after the first is taken as even in all directions, so that the orders form a geometric series.
Hillaire (2020), A scalable and production ready sky and atmosphere rendering technique, Computer Graphics Forum 39(4),
section 5.5.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.atmosphere import (
    MultipleScattering,
    optical_depth_to_top,
    sun_share,
)
from flyaround.simulator.world.bodies.earth import EARTH

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere

HEIGHTS, SUNS = 24, 33
_STEPS = 16
_POLAR, _TURNS = 8, 6


def multiple_scattering(air: Atmosphere, ground_albedo: float = EARTH.albedo) -> MultipleScattering:
    """The table of one atmosphere over ground that reflects evenly."""
    # the middle column lies on the horizon
    column = np.linspace(-1, 1, SUNS)
    mu_sun = np.sign(column) * column**2
    # a metre above the ground, a metre below the top: rays then know where they are
    height = np.linspace(0, 1, HEIGHTS) ** 2 * air.thickness_m
    height = np.clip(height, 1.0, air.thickness_m - 1.0)
    rays, weight = _sphere()
    suns = np.stack([np.sqrt(1 - mu_sun**2), np.zeros_like(mu_sun), mu_sun], axis=1)
    sunlight = _SunTable(air)
    psi = _second_and_on(air, sunlight, air.radius_m + height, rays, weight, suns, ground_albedo)
    return MultipleScattering(psi, air.thickness_m)


def _sphere() -> tuple[FloatArray, FloatArray]:
    """Directions (K, 3) over the whole sphere, and weights that add up to one."""
    nodes, weights = np.polynomial.legendre.leggauss(_POLAR)
    c, a = (v.ravel() for v in np.meshgrid(nodes, (np.arange(_TURNS) + 0.5) / _TURNS * np.pi, indexing="ij"))
    s = np.sqrt(1 - c * c)
    # the sky is symmetric about the Sun's vertical: half of the turns are enough
    return np.stack([s * np.cos(a), s * np.sin(a), c], axis=1), np.repeat(weights / 2, _TURNS) / _TURNS


class _SunTable:
    """Transmittance to the Sun, from optical depths by height and cosine above the horizon; 1e-3 and faster."""

    def __init__(self, air: Atmosphere) -> None:
        from scipy.interpolate import RegularGridInterpolator  # noqa: PLC0415 - slow to import: maps are begun before

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


def _second_and_on(
    air: Atmosphere,
    sunlight: _SunTable,
    radius_m: FloatArray,
    rays: FloatArray,
    weight: FloatArray,
    suns: FloatArray,
    albedo: float,
) -> FloatArray:
    """Mean radiance (H, SUNS, n) of all higher orders at some radii (H,), for every height of the Sun."""
    mu, at = rays[:, 2], radius_m[:, None]
    to_top = -at * mu + np.sqrt((at * mu) ** 2 + air.top_m**2 - at**2)
    under = (at * mu) ** 2 + air.radius_m**2 - at**2
    grounded = (under > 0) & (mu < 0)
    length = np.where(grounded, -at * mu - np.sqrt(np.clip(under, 0, None)), to_top)
    depth = np.zeros((*length.shape, len(air.rayleigh_m)))
    first = np.zeros((*length.shape, len(suns), len(air.rayleigh_m)))
    scattered = np.zeros_like(depth)
    start = np.array([0.0, 0.0, 1.0]) * radius_m[:, None, None]
    for k in range(_STEPS):
        # dense near the point, where most of the light is
        edge0, edge1 = (k / _STEPS) ** 2, ((k + 1) / _STEPS) ** 2
        t, dt = 0.5 * (edge0 + edge1) * length, (edge1 - edge0) * length
        p = start + t[..., None] * rays
        r = np.linalg.norm(p, axis=-1)
        rayleigh, mie, _ = air.density(r - air.radius_m)
        scatters = rayleigh[..., None] * air.rayleigh_m + mie[..., None] * air.mie_scattering_m
        extinction = air.extinction_m(r - air.radius_m)
        # analytic over the step: exact for even air, however thick
        through = np.exp(-extinction * dt[..., None])
        arrives = np.exp(-depth) * scatters * (1 - through) / np.maximum(extinction, 1e-30)
        mu_sun = np.clip(p @ suns.T / r[..., None], -1, 1)
        first += arrives[..., None, :] * sunlight(np.broadcast_to(r[..., None], mu_sun.shape), mu_sun)
        scattered += arrives
        depth += extinction * dt[..., None]
    radiance = first / (4 * np.pi)
    foot = start + length[..., None] * rays
    mu_sun = np.clip(foot @ suns.T / air.radius_m, -1, 1)
    ground = sunlight(np.full(mu_sun.shape, air.radius_m), mu_sun) * np.clip(mu_sun, 0, None)[..., None]
    reflected = np.exp(-depth)[..., None, :] * ground * albedo / np.pi
    radiance += np.where(grounded[..., None, None], reflected, 0.0)
    second = np.stack([np.einsum("k,ksn->sn", weight, one) for one in radiance])
    # share of light from all around that is scattered on to here
    again = np.stack([weight @ one for one in scattered])[:, None]
    return np.asarray(second / (1 - again))
