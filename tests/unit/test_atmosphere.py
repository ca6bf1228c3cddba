"""The air in double precision: where the light goes, and published figures of the clear sky."""

from dataclasses import replace

import numpy as np
import pytest

from simulator.scene.atmosphere import earth_atmosphere, ground_irradiance, path_light, rayleigh_phase
from simulator.scene.multiple_scattering import multiple_scattering


def test_what_enters_conservative_air_leaves_it_or_reaches_the_ground():
    # blue light in air that absorbs nothing, over black ground
    air = earth_atmosphere("rgb")
    air = replace(
        air,
        rayleigh_m=air.rayleigh_m[2:],
        mie_scattering_m=np.zeros(1),
        mie_extinction_m=np.zeros(1),
        ozone_m=np.zeros(1),
    )
    table = multiple_scattering(air, ground_albedo=0.0)
    for mu in (1.0, 0.6):
        direct, sky = ground_irradiance(air, np.array([mu]), multiple=table)
        # what leaves through the top: rays from space that look down at one place, all around
        nodes, weights = np.polynomial.legendre.leggauss(8)
        c, a = (
            v.ravel() for v in np.meshgrid(0.5 * (nodes + 1), (np.arange(8) + 0.5) / 8 * np.pi, indexing="ij")
        )
        s = np.sqrt(1 - c * c)
        rays = -np.stack([s * np.cos(a), s * np.sin(a), c], axis=1)
        sun = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
        light = path_light(air, np.array([0, 0, air.top_m]), rays, sun, steps=32, multiple=table)
        out = (light.rayleigh * rayleigh_phase(rays @ sun)[:, None] + light.multiple)[:, 0]
        up = (np.repeat(0.5 * weights, 8) * c * 2 * np.pi / 8) @ out
        assert (direct + sky)[0, 0] + up == pytest.approx(mu, rel=0.02)


def test_share_of_the_sky_in_the_light_of_a_clear_day():
    # ASTM G173 (2012), 48 degrees from the zenith, aerosol 0.084 at 500 nm: (global on level ground) / direct of a
    # clear day's blue, green, red. Its own table is for a tilted plane; Bird & Riordan (1986), fig. 5: the sky gives
    # a third of the blue light at 450 nm and a tenth of the red at 650 nm.
    air = earth_atmosphere("rgb")
    direct, sky = ground_irradiance(
        air, np.array([np.cos(np.radians(48.2))]), multiple=multiple_scattering(air)
    )
    red, green, blue = (sky / (direct + sky))[0]
    assert 0.05 < red < 0.12
    assert red < green < blue
    assert 0.15 < blue < 0.35


def test_higher_orders_brighten_the_blue_most():
    # Bates & Porter (2008), Icarus 196; Chandrasekhar's tables: at an optical depth of 0.2 to 0.25 (blue) over dark
    # ground higher orders add a quarter to a half to the zenith's light
    air = earth_atmosphere("rgb")
    table = multiple_scattering(air, ground_albedo=0.0)
    up, sun = np.array([[0.0, 0.0, 1.0]]), np.array([np.sqrt(0.75), 0.0, 0.5])
    light = path_light(air, np.array([0, 0, air.radius_m + 1.0]), up, sun, multiple=table)
    first = light.rayleigh[0] * rayleigh_phase(np.array(0.5))
    share = light.multiple[0] / first
    assert np.all(np.diff(share) > 0)
    assert 0.2 < share[2] < 0.6


def test_the_table_is_smooth_and_dark_at_night():
    table = multiple_scattering(earth_atmosphere("mono"))
    assert np.all(table.psi >= 0)
    assert table(np.array([0.0]), np.array([-0.9]))[0, 0] == 0
    assert np.all(np.diff(table(np.full(20, 500.0), np.linspace(-0.1, 1, 20))[:, 0]) > 0)
