"""Rows of the rendering page on the atmosphere: radiances against a solver of the full radiative transfer equation."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.atmosphere import (
    earth_atmosphere,
    ground_irradiance,
    mie_phase,
    path_light,
    rayleigh_phase,
)
from flyaround.simulator.scene.illumination.multiple_scattering import multiple_scattering
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere, MultipleScattering
    from flyaround.simulator.scene.illumination.bands import Bands

REFERENCE = Path("tests/reference/disort.csv")
GROUNDS, SUNS_DEG = (0.0, 0.3, 0.8), (30.0, 60.0, 75.0)  # albedos of the ground, zenith angles of the Sun
# nadir angles and azimuths of the view
VIEWS_DEG, AZIMUTHS_DEG = (10.0, 25.0, 40.0, 55.0, 66.0), (0.0, 90.0, 180.0)
FLAT_RADIUS_M = 6.4e8  # the solver's atmosphere is plane-parallel
NOTES = """
Relative differences from PythonicDISORT 1.8 (Ho 2024, J. Open Source Softw. 9, 6442; 32 streams, delta-M and
Nakajima-Tanaka corrections), over ground of albedo 0, 0.3 and 0.8, the Sun 30, 60 and 75 deg and the view 10 to 66
deg from the zenith, at azimuths of 0 (towards the glint), 90 and 180 deg. Optical depths, phase functions and
profiles are ours on both sides, the Earth's radius a hundredfold, because the solver's air is plane (`python -m
tests.reference.make_disort`). The largest differences are of light that the aerosol scatters forward twice: a low Sun
ahead, over black ground.
"""


def flat_air(bands: Bands) -> Atmosphere:
    """Return the Earth's atmosphere over a nearly flat ground."""
    return replace(earth_atmosphere(bands), radius_m=FLAT_RADIUS_M)


@dataclass(frozen=True, eq=False)
class Light:
    """Light divided by the Sun's irradiance; last axis panchromatic, red, green, blue.

    Parameters
    ----------
    up : (grounds, Suns, views, azimuths, 4) array
        Upward radiance at the top of the atmosphere [sr-1].
    down : (grounds, Suns, views, azimuths, 4) array
        Radiance of the sky at the ground [sr-1].
    ground : (grounds, Suns, 4) array
        Irradiance of level ground [1].
    """

    up: FloatArray
    down: FloatArray
    ground: FloatArray


def solver_light() -> Light:
    """Return the stored light of the solver."""
    with REFERENCE.open(newline="") as file:
        rows = list(csv.reader(file))[1:]

    def part(quantity: str, *shape: int) -> FloatArray:
        values = np.array([[float(x) for x in row[5:]] for row in rows if row[0] == quantity])
        return values.reshape(len(GROUNDS), len(SUNS_DEG), *shape, 4)

    directions = len(VIEWS_DEG), len(AZIMUTHS_DEG)
    return Light(part("up", *directions), part("down", *directions), part("ground"))


def our_light() -> Light:
    """Return the light of our model, in double precision."""
    by_time: list[list[FloatArray]] = [[], [], []]
    for bands in ("mono", "rgb"):
        air = flat_air(bands)
        tables = [multiple_scattering(air, ground) for ground in GROUNDS]
        cases = [
            [_light(air, table, ground, sun) for sun in SUNS_DEG]
            for ground, table in zip(GROUNDS, tables, strict=True)
        ]
        for k, radiances in enumerate(by_time):
            radiances.append(np.array([[case[k] for case in row] for row in cases]))
    return Light(*(np.concatenate(radiances, axis=-1) for radiances in by_time))


def _light(
    air: Atmosphere, table: MultipleScattering, ground: float, sun_deg: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return upward and downward radiance (views, azimuths, n) and irradiance of the ground (n,)."""
    sun = np.array([-np.sin(np.radians(sun_deg)), 0.0, np.cos(np.radians(sun_deg))])
    view, azimuth = np.meshgrid(np.radians(VIEWS_DEG), np.radians(AZIMUTHS_DEG), indexing="ij")
    up = np.stack([np.sin(view) * np.cos(azimuth), np.sin(view) * np.sin(azimuth), np.cos(view)], axis=-1)
    direct, diffuse = ground_irradiance(air, sun[2:], multiple=table)
    falling = (direct + diffuse)[0]
    foot = np.array([0.0, 0.0, air.radius_m + 1.0])
    out = []
    for direction in up.reshape(-1, 3):
        along = foot @ direction
        reach = np.sqrt(along**2 + air.top_m**2 - foot @ foot) - along
        leaves, through = _seen(air, table, foot + (reach + 1.0) * direction, -direction, sun)
        # light that travels towards an azimuth comes from the opposite side
        sky, _ = _seen(air, table, foot, direction * (-1, -1, 1), sun)
        out.append((leaves + through * falling * ground / np.pi, sky))
    leaves, sky = np.moveaxis(np.reshape(out, (*view.shape, 2, -1)), 2, 0)
    return leaves, sky, falling


def _seen(
    air: Atmosphere, table: MultipleScattering, start: FloatArray, ray: FloatArray, sun: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the radiance (n,) of the air along a ray over the Sun's irradiance, and its transmittance (n,)."""
    path, cosine = path_light(air, start, ray[None], sun, steps=32, multiple=table), np.asarray(ray @ sun)
    light = path.rayleigh * rayleigh_phase(cosine) + path.mie * mie_phase(cosine, air.mie_g) + path.multiple
    return light[0], path.transmittance[0]


def rows(renderer: Renderer | None = None) -> list[Row]:  # noqa: ARG001 - the physics alone; another row covers the rendering
    """Measure and return every comparison."""
    rendered, solver = our_light(), solver_light()
    up, down, ground = (getattr(rendered, n) / getattr(solver, n) - 1 for n in ("up", "down", "ground"))
    measured = [
        (
            f"light leaving the air, albedo {albedo:g}, largest of all bands",
            goal,
            np.abs(up[k]).max(),
        )
        for k, (albedo, goal) in enumerate(zip(GROUNDS, (0.12, 0.08, 0.06), strict=True))
    ]
    measured += [
        ("the same, rms of all", 0.03, _rms(up)),
        ("its blue over its red, rms", 0.02, _rms((1 + up[..., 3]) / (1 + up[..., 1]) - 1)),
        ("light on the ground, largest", 0.04, np.abs(ground).max()),
        ("sky from ground of albedo 0 and 0.3, rms", 0.06, _rms(down[:2])),
        ("its blue over its red, rms", 0.06, _rms((1 + down[:2, ..., 3]) / (1 + down[:2, ..., 1]) - 1)),
    ]
    return [
        Row(
            what=quantity,
            against="PythonicDISORT",
            unit="1",
            goal=goal,
            measured=float(value),
        )
        for quantity, goal, value in measured
    ]


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
