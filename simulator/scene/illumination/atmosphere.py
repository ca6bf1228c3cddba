"""Scattering in a spherical atmosphere in double precision: reference and table source for the renderer.

Lengths are in metres, heights above a sphere of Earth's equatorial radius. The renderer first stretches the ellipsoid's
polar axis to this sphere, so that one atmosphere fits every latitude.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.bands import bands_of
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.constants import EARTH_RADIUS_M
from flyaround.simulator.world.ephemeris.body import MAX_LAYERS, BodyAir

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.world.ephemeris.body import Body

SUN_ANGULAR_RADIUS_RAD = 0.004652  # IAU 2015 nominal solar radius at 1 au
OZONE_HEIGHT_M, OZONE_HALF_WIDTH_M = 25_000.0, 15_000.0  # centre and half width of a tent-shaped profile
LAYERS = MAX_LAYERS - 1  # exponential layers of the Rayleigh scatterers' density

# Air of a body without atmosphere: it scatters nothing.
_NO_AIR = BodyAir(rayleigh_m_um4=0.0, rayleigh_height_m=1000.0, thickness_m=5000.0)


@dataclass(frozen=True, eq=False)
class Atmosphere:
    """Optical properties per band.

    Parameters
    ----------
    rayleigh_m : (n,) array
        Scattering at sea level [m-1].
    mie_scattering_m : array
        Scattering coefficient of the aerosol at the ground [m-1].
    mie_extinction_m : array
        Extinction coefficient of the aerosol at the ground [m-1].
    ozone_m : (n,) array
        Absorption at the peak of the layer [m-1].
    layers_m : (LAYERS,) array
        Lower bounds of the exponential layers of Rayleigh scatterers [m].
    falls_m : (LAYERS,) array
        Increase of the density's logarithmic slope at each bound [m-1].
    aerosol_depth : float
        Vertical optical depth of the aerosol at 550 nm.
    mie_height_m : float
        Scale height of the aerosol [m].
    mie_g : float
        Asymmetry of the Cornette-Shanks phase function.
    airglow_w_m2_sr : (n,) array
        Radiance of the airglow at the zenith [W m-2 sr-1].
    airglow_m : tuple of float
        Lower and upper edge [m].
    thickness_m : float
        Height of the top [m].
    radius_m : float, optional
        Radius of the ground.
    """

    rayleigh_m: FloatArray
    mie_scattering_m: FloatArray
    mie_extinction_m: FloatArray
    ozone_m: FloatArray
    layers_m: FloatArray
    falls_m: FloatArray
    aerosol_depth: float
    mie_height_m: float
    mie_g: float
    airglow_w_m2_sr: FloatArray
    airglow_m: tuple[float, float]
    thickness_m: float
    radius_m: float = field(default=EARTH_RADIUS_M)

    @property
    def top_m(self) -> float:
        """Radius of the top [m]."""
        return self.radius_m + self.thickness_m

    def density(self, height_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the densities of the air's parts at a height.

        Returns
        -------
        tuple of array
            Rayleigh and aerosol density relative to sea level, and ozone density relative to its peak, each in the
            shape of ``height_m``; below sea level those of sea level.
        """
        h = np.maximum(height_m, 0.0)
        fall = np.zeros_like(h)
        for layer, more in zip(self.layers_m, self.falls_m, strict=True):
            fall += more * np.maximum(h - layer, 0.0)
        ozone = np.clip(1 - np.abs(h - OZONE_HEIGHT_M) / OZONE_HALF_WIDTH_M, 0, None)
        return np.exp(-fall), np.exp(-h / self.mie_height_m), ozone

    def extinction_m(self, height_m: FloatArray) -> FloatArray:
        """Return the extinction at a height.

        Returns
        -------
        (..., n) array
            Extinction per band [m-1].
        """
        rayleigh, mie, ozone = self.density(height_m)
        return (
            rayleigh[..., None] * self.rayleigh_m
            + mie[..., None] * self.mie_extinction_m
            + ozone[..., None] * self.ozone_m
        )


@lru_cache(maxsize=16)
def earth_atmosphere(
    bands: Bands, thickness_m: float = 100_000.0, aerosol_depth: float | None = None
) -> Atmosphere:
    """Return the Earth's atmosphere; the parameters are those of `body_atmosphere`.

    Returns
    -------
    Atmosphere
        Cached: the same object for the same arguments.
    """
    return body_atmosphere(EARTH, bands, thickness_m, aerosol_depth)


def body_atmosphere(
    body: Body, bands: Bands, thickness_m: float | None = None, aerosol_depth: float | None = None
) -> Atmosphere:
    """Return the atmosphere of a body, per band.

    Optical depths are unweighted means over a band's wavelengths.

    Parameters
    ----------
    body : Body
        Body with or without air.
    bands : Bands
        Spectral bands of the image.
    thickness_m : float, optional
        Height of the top, by default the body's; densities below do not change.
    aerosol_depth : float, optional
        Vertical optical depth of the aerosol at 550 nm, by default the body's.

    Returns
    -------
    Atmosphere
        Atmosphere; that of a body without air scatters and absorbs nothing.
    """
    air = body.air or _NO_AIR
    a, b = air.rayleigh_dispersion_um
    aerosol_m = air.aerosol_m if aerosol_depth is None else aerosol_depth / air.aerosol_height_m
    all_bands = bands_of(bands)
    wavelengths_um = [1e-3 * (np.arange(band.low_nm, band.high_nm) + 0.5) for band in all_bands]
    rayleigh = [float(np.mean((1 + a / um**2 + b / um**4) / um**4)) for um in wavelengths_um]
    aerosol = [float(np.mean((um / 0.55) ** -air.aerosol_exponent)) for um in wavelengths_um]
    extinction = aerosol_m * np.array(aerosol)
    layers_m, falls_m = _layers(air)
    return Atmosphere(
        rayleigh_m=air.rayleigh_m_um4 * np.array(rayleigh),
        mie_scattering_m=air.aerosol_albedo * extinction,
        mie_extinction_m=extinction,
        ozone_m=np.array([air.ozone_m.get(band.name, 0.0) for band in all_bands]),
        layers_m=layers_m,
        falls_m=falls_m,
        aerosol_depth=round(aerosol_m * air.aerosol_height_m, 9),  # recover the given number
        mie_height_m=air.aerosol_height_m,
        mie_g=air.aerosol_g,
        airglow_w_m2_sr=np.array([air.airglow_w_m2_sr.get(band.name, 0.0) for band in all_bands]),
        airglow_m=air.airglow_m,
        thickness_m=air.thickness_m if thickness_m is None else thickness_m,
        radius_m=body.radius_m,
    )


def _layers(air: BodyAir) -> tuple[FloatArray, FloatArray]:
    """Return the lowest heights and slope increases of the density (LAYERS,), see `Atmosphere`."""
    profile = air.density or ((0.0, 1.0), (air.rayleigh_height_m, float(np.exp(-1.0))))
    height, density = np.array(profile).T
    falls = np.diff(-np.diff(np.log(density)) / np.diff(height), prepend=0.0)
    layers_m, falls_m = np.zeros(LAYERS), np.zeros(LAYERS)
    layers_m[: len(falls)], falls_m[: len(falls)] = height[:-1], falls
    return layers_m, falls_m


def rayleigh_phase(cosine: FloatArray) -> FloatArray:
    """Return the Rayleigh phase function.

    Returns
    -------
    array
        Values [sr-1] at cosines of the scattering angle, normalised to 1 over the sphere.
    """
    return 3 / (16 * np.pi) * (1 + cosine**2)


def mie_phase(cosine: FloatArray, g: float) -> FloatArray:
    """Return the phase function of Cornette & Shanks (1992) with asymmetry ``g``.

    Returns
    -------
    array
        Values [sr-1] at cosines of the scattering angle, normalised to 1 over the sphere.
    """
    scale = 3 / (8 * np.pi) * (1 - g * g) / (2 + g * g)
    return scale * (1 + cosine**2) / (1 + g * g - 2 * g * cosine) ** 1.5


def sun_share(radius_m: FloatArray, mu_sun: FloatArray, ground_m: float) -> FloatArray:
    """Return the share of the Sun's disc above the horizon at a radius, 0..1 (smoothstep over the disc's diameter).

    Parameters
    ----------
    radius_m : array
        Distance from the centre.
    mu_sun : array
        Cosine of the Sun's zenith angle.
    ground_m : float
        Radius of the ground [m].
    """
    horizon = -np.sqrt(np.clip(1 - (ground_m / np.maximum(radius_m, ground_m)) ** 2, 0, None))
    x = np.clip((mu_sun - horizon) / (2 * SUN_ANGULAR_RADIUS_RAD) + 0.5, 0, 1)
    return x * x * (3 - 2 * x)


def optical_depth_to_top(
    air: Atmosphere, radius_m: FloatArray, mu: FloatArray, steps: int = 64
) -> FloatArray:
    """Return the optical depth from a radius along zenith cosine ``mu`` to the top.

    Returns
    -------
    (..., n) array
        Optical depth per band. The ground does not end the ray.
    """
    r, mu = np.broadcast_arrays(np.asarray(radius_m, float), np.asarray(mu, float))
    length = np.asarray(-r * mu + np.sqrt(np.clip((r * mu) ** 2 + air.top_m**2 - r * r, 0, None)))
    # denser samples near the lowest point of the ray: its start, or its perigee if it descends
    low = np.asarray(np.clip(-r * mu, 0, length))
    edges = np.linspace(0, 1, steps + 1)
    x = 0.5 * (edges[1:] + edges[:-1])
    depth = np.zeros((*r.shape, len(air.rayleigh_m)))
    # descending rays: to the lowest point, and from there to the top
    for begin, end, which in ((low, np.zeros_like(low), low > 0), (low, length, np.ones(low.shape, bool))):
        if not which.any():
            continue
        radius, start = r[which][:, None], begin[which][:, None]
        # quadratic spacing away from the lowest point
        span = end[which][:, None] - start
        t = start + span * x**2
        height = np.sqrt(radius**2 + t * t + 2 * radius * mu[which][:, None] * t) - air.radius_m
        weight = np.abs(span) * 2 * x / steps
        depth[which] += (air.extinction_m(height) * weight[..., None]).sum(axis=-2)
    return depth


def transmittance_to_sun(air: Atmosphere, radius_m: FloatArray, mu_sun: FloatArray) -> FloatArray:
    """Return the transmittance (..., n) to the Sun at a radius, including the horizon."""
    share = np.asarray(sun_share(np.asarray(radius_m, float), np.asarray(mu_sun, float), air.radius_m))
    # if the Sun's centre is below the horizon, only the upper part of the disc is visible, through the horizon's air
    r = np.maximum(np.asarray(radius_m, float), air.radius_m)
    horizon = -np.sqrt(np.clip(1 - (air.radius_m / r) ** 2, 0, None))
    mu = np.asarray(np.maximum(mu_sun, horizon))
    through = np.zeros((*share.shape, len(air.rayleigh_m)))
    is_lit = share > 0
    through[is_lit] = np.exp(-optical_depth_to_top(air, np.broadcast_to(r, is_lit.shape)[is_lit], mu[is_lit]))
    return through * share[..., None]


@dataclass(frozen=True, eq=False)
class PathLight:
    """In-scattered radiance per unit irradiance, without phase function [1], and transmittance [1], of a path.

    Parameters
    ----------
    rayleigh : (K, n) array
        Light scattered once by molecules [sr-1 per unit phase function].
    mie : (K, n) array
        Light scattered once by the aerosol.
    transmittance : (K, n) array
        Transmittance of the path.
    multiple : (K, n) array
        Light scattered at least twice, isotropic [sr-1]; zero if not requested.
    """

    rayleigh: FloatArray
    mie: FloatArray
    transmittance: FloatArray
    multiple: FloatArray


@dataclass(frozen=True, eq=False)
class MultipleScattering:
    """Radiance at a point after at least two scatterings, averaged over directions.

    Parameters
    ----------
    psi : (HEIGHTS, SUNS, n) array
        Radiance over the Sun's irradiance [sr-1]; rows: square root of height over thickness; columns: cosine of the
        Sun's zenith angle, -1 to 1, stretched around the horizon (``sun_column``).
    thickness_m : float
        Height of the top of the atmosphere.
    """

    psi: FloatArray
    thickness_m: float

    def __call__(self, height_m: FloatArray, mu_sun: FloatArray) -> FloatArray:
        """Return the linearly interpolated table: (..., n)."""
        row = np.sqrt(np.clip(height_m / self.thickness_m, 0, 1))
        return interpolate_table(self.psi, row, sun_column(np.asarray(mu_sun, float)))


def interpolate_table(table: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
    """Interpolate a table (rows, columns, n) linearly at positions 0..1 along its axes: (..., n)."""
    rows, columns, _ = table.shape
    y, x = np.broadcast_arrays(row * (rows - 1), column * (columns - 1))
    i, k = np.minimum(y.astype(int), max(rows - 2, 0)), np.minimum(x.astype(int), columns - 2)
    below = np.minimum(i + 1, rows - 1)
    fy, fx = (y - i)[..., None], (x - k)[..., None]
    low = table[i, k] * (1 - fx) + table[i, k + 1] * fx
    high = table[below, k] * (1 - fx) + table[below, k + 1] * fx
    return np.asarray(low * (1 - fy) + high * fy)


def sun_column(mu_sun: FloatArray) -> FloatArray:
    """Return the column 0..1 of a cosine -1..1; half of the columns lie within 0.25 of the horizon."""
    return np.asarray(0.5 + 0.5 * np.sign(mu_sun) * np.sqrt(np.abs(mu_sun)))


def path_light(
    air: Atmosphere,
    camera_m: FloatArray,
    directions: FloatArray,
    sun: FloatArray,
    steps: int = 64,
    multiple: MultipleScattering | None = None,
) -> PathLight:
    """Compute the light scattered along rays (K, 3) from a camera outside or inside the air, to ground or space.

    The radiance is ``E_sun * (rayleigh * rayleigh_phase + mie * mie_phase + multiple)``.

    Parameters
    ----------
    air : Atmosphere
        Atmosphere of the body.
    camera_m : (3,) array
        Position from the Earth's centre.
    directions : (K, 3) array
        Unit vectors.
    sun : (..., 3) array
        Unit vectors to the Sun; with several, in-scatter is (..., K, n) and transmittance (K, n).
    steps : int, optional
        Number of integration steps.
    multiple : MultipleScattering, optional
        Table of light scattered at least twice, to be added.

    Returns
    -------
    PathLight
        In-scattered light and transmittance of each ray, per band.
    """
    d = np.asarray(directions, float)
    b = d @ camera_m
    c2 = float(camera_m @ camera_m)
    to_top = b * b - c2 + air.top_m**2
    to_ground = b * b - c2 + air.radius_m**2
    hit_air = (to_top > 0) & ((-b + np.sqrt(np.clip(to_top, 0, None))) > 0)
    hit_ground = (to_ground > 0) & (b < 0)
    start = np.maximum(-b - np.sqrt(np.clip(to_top, 0, None)), 0)
    end = np.where(
        hit_ground, -b - np.sqrt(np.clip(to_ground, 0, None)), -b + np.sqrt(np.clip(to_top, 0, None))
    )
    length = np.where(hit_air, np.maximum(end - start, 0), 0)
    inside = ~hit_ground & (start == 0)
    depth = np.zeros((len(d), len(air.rayleigh_m)))
    rayleigh, mie, more = (np.zeros((*sun.shape[:-1], *depth.shape)) for _ in range(3))
    for k in range(steps):
        # steps get shorter towards the ground, where the aerosol is, and away from a camera in the air; otherwise they
        # are uniform, which converges fast for the bell-shaped density about the perigee
        x = (k + 0.5) / steps
        t = start + length * np.where(hit_ground, 1 - (1 - x) ** 2, np.where(inside, x**2, x))
        dt = length / steps * np.where(hit_ground, 2 * (1 - x), np.where(inside, 2 * x, 1.0))
        p = camera_m + t[:, None] * d
        r = np.linalg.norm(p, axis=1)
        density_r, density_m, _ = air.density(r - air.radius_m)
        step_depth = air.extinction_m(r - air.radius_m) * dt[:, None]
        mu_sun = sun @ p.T / r
        half2 = 0.25 * step_depth**2
        # mean over the step of exponentially decaying light: series of sinh(x) / x
        arrives = np.exp(-(depth + 0.5 * step_depth)) * (1 + half2 * (1 / 6 + half2 / 120)) * dt[:, None]
        light = transmittance_to_sun(air, r, mu_sun) * arrives
        rayleigh += density_r[:, None] * light * air.rayleigh_m
        mie += density_m[:, None] * light * air.mie_scattering_m
        if multiple is not None:
            scatters = density_r[:, None] * air.rayleigh_m + density_m[:, None] * air.mie_scattering_m
            more += scatters * arrives * multiple(r - air.radius_m, mu_sun)
        depth += step_depth
    return PathLight(rayleigh, mie, np.exp(-depth), more)


def airglow_path(air: Atmosphere, perigee_m: FloatArray) -> FloatArray:
    """Compute path lengths through the airglow over that at the zenith, for rays from space that miss the ground.

    Parameters
    ----------
    air : Atmosphere
        Atmosphere of the body.
    perigee_m : array
        Least distances of the rays from the centre.
    """
    low, high = (air.radius_m + height for height in air.airglow_m)
    a, b = low**2 - perigee_m**2, high**2 - perigee_m**2
    # emission (r^2 - low^2) (high^2 - r^2): integral along the ray from the perigee to each edge
    t, u = (np.sqrt(np.maximum(v, 0)) for v in (a, b))
    near, far = (x * (x * x * ((a + b) / 3 - 0.2 * x * x) - a * b) for x in (t, u))
    middle, thick = 0.5 * (low + high), high - low
    return np.asarray(3 * (far - near) / (middle**2 * thick**3))


def ground_irradiance(
    air: Atmosphere,
    mu_sun: FloatArray,
    *,
    diffuse: bool = True,
    multiple: MultipleScattering | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute the irradiance of level ground.

    Parameters
    ----------
    air : Atmosphere
        Atmosphere of the body.
    mu_sun : (K,) array
        Cosines of the Sun's zenith angle.
    diffuse : bool, optional
        False to omit the diffuse part, which takes most of the time.
    multiple : MultipleScattering, optional
        Table of light scattered at least twice, added to the diffuse part.

    Returns
    -------
    direct : (K, n) array
        Direct irradiance per band, relative to the Sun's above the air at normal incidence.
    diffuse : (K, n) array
        The same of the sky; zero if it is omitted.
    """
    mu_sun = np.asarray(mu_sun, float)
    direct = (
        transmittance_to_sun(air, np.full_like(mu_sun, air.radius_m), mu_sun)
        * np.clip(mu_sun, 0, None)[:, None]
    )
    if not diffuse:
        return direct, np.zeros_like(direct)
    point = np.array([0.0, 0.0, air.radius_m + 1.0])
    zenith_nodes, zenith_weights = np.polynomial.legendre.leggauss(8)
    cosine = 0.5 * (zenith_nodes + 1)
    azimuth = (np.arange(8) + 0.5) / 8 * np.pi  # the sky is symmetric about the Sun's vertical
    c, a = (v.ravel() for v in np.meshgrid(cosine, azimuth, indexing="ij"))
    s = np.sqrt(1 - c * c)
    rays = np.stack([s * np.cos(a), s * np.sin(a), c], axis=1)
    weight = np.repeat(0.5 * zenith_weights, 8) * c * 2 * np.pi / 8
    suns = np.stack([np.sqrt(np.maximum(1 - mu_sun**2, 0.0)), np.zeros_like(mu_sun), mu_sun], axis=1)
    light = path_light(air, point, rays, suns, steps=16, multiple=multiple)
    angle = suns @ rays.T
    radiance = (
        light.rayleigh * rayleigh_phase(angle)[..., None]
        + light.mie * mie_phase(angle, air.mie_g)[..., None]
        + light.multiple
    )
    return direct, np.asarray(weight @ radiance)
