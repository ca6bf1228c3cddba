"""Stars in view: catalogue positions moved to the epoch, magnitudes as irradiance in the camera's bands."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.celestial.star_colours import (
    hp_minus_v,
    irradiance_of_v_mag,
    photons_over_sunlights,
    plausible_v_minus_i,
    typical_v_minus_i,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.world.time.instant import datetime_utc

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands

CATALOGUE = "hipparcos2_hp9.npz"
_CATALOGUE_EPOCH = datetime(1991, 4, 2, 13, 30, tzinfo=UTC)  # J1991.25

# Hipparcos number of Sirius.
_SIRIUS_HIP = 32349
_SIRIUS_HP_MAG = -1.43  # V = -1.44; the catalogue's Hp of -1.09 comes from a saturated detector
_SUN_B_MINUS_V = 0.65  # colour of a star without a measured one
_SIDE = 12  # cells along the edge of each face of the cube map
CELL_RADIUS_RAD = 0.125  # half of the diagonal of the largest cell

# A milliarcsecond [rad].
_MAS_RAD = np.pi / 180 / 3_600_000


@dataclass(frozen=True, eq=False)
class StarField:
    """Stars of one epoch and camera.

    Parameters
    ----------
    directions : (3, K) array
        Unit vectors, GCRS.
    irradiance_w_m2 : (n, K) array
        Irradiance per band above the air; with ``by_photons``, of sunlight with equal photons.
    cells : (C, 3) array
        Centres of the sky cells by which the stars are sorted.
    first : (C + 1,) array
        Index of the first star of each cell.
    """

    directions: FloatArray
    irradiance_w_m2: FloatArray
    cells: FloatArray
    first: np.typing.NDArray[np.intp]

    def near(self, axis: FloatArray, angle_rad: float) -> tuple[FloatArray, FloatArray]:
        """Return directions (3, K) and irradiance (n, K) of all stars within an angle of an axis.

        Further stars of the same sky cells are included.
        """
        hit = np.zeros(len(self.cells) + 2, bool)
        hit[1:-1] = self.cells @ axis > np.cos(min(angle_rad + CELL_RADIUS_RAD, np.pi))
        # consecutive cells form one slice
        ends = self.first[np.flatnonzero(hit[1:] != hit[:-1])].reshape(-1, 2).tolist()
        spans = [slice(start, end) for start, end in ends] or [slice(0, 0)]
        directions = np.concatenate([self.directions[:, span] for span in spans], axis=1)
        return directions, np.concatenate([self.irradiance_w_m2[:, span] for span in spans], axis=1)


@functools.cache
def _catalogue() -> dict[str, FloatArray]:
    try:
        data = resources.files("flyaround.assets").joinpath("stars", CATALOGUE).open("rb")
    except FileNotFoundError as error:
        raise UserError(
            f"the catalogue assets/stars/{CATALOGUE} is missing; install Flyaround again"
        ) from error
    with data, np.load(data) as arrays:
        return {name: np.asarray(arrays[name], float) for name in arrays.files}


def stars(epoch_utc: str, bands: Bands, *, by_photons: bool = False) -> StarField:
    """Return the whole catalogue at an epoch.

    Parameters
    ----------
    epoch_utc : str
        ISO 8601. Proper motion is applied for whole years: half a year moves 97 % of the stars by less than 0.1 arcsec.
    bands : Bands
        Spectral bands of the image.
    by_photons : bool, optional
        True for a detector that counts photons, of which a red star has more per joule than a blue one.

    Returns
    -------
    StarField
        Directions, GCRS, and irradiances per band [W m-2].
    """
    epoch = datetime_utc(epoch_utc)
    return _stars_of_year(round((epoch - _CATALOGUE_EPOCH).days / 365.25), bands, by_photons)


@functools.lru_cache(maxsize=4)
def _stars_of_year(years: int, bands: Bands, by_photons: bool) -> StarField:  # noqa: FBT001 - a key of the cache
    c = _catalogue()
    ra, dec = np.radians(c["ra_deg"]), np.radians(c["dec_deg"])
    east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=1)
    north = np.stack([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)], axis=1)
    directions_1991 = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=1)
    directions = directions_1991 + years * _MAS_RAD * (
        c["pm_ra_mas_yr"][:, None] * east + c["pm_dec_mas_yr"][:, None] * north
    )
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cell = _cell(directions)
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(6 * _SIDE * _SIDE + 1))
    hp, bv = np.where(c["hip"] == _SIRIUS_HIP, _SIRIUS_HP_MAG, c["hp_mag"]), c["b_minus_v_mag"]
    vi = plausible_v_minus_i(bv, c["v_minus_i_mag"])
    light = star_irradiance_w_m2(hp, bv, bands, vi)
    if by_photons:
        light = light * photons_over_sunlights(vi, bands)
    directions, irradiance = (np.ascontiguousarray(values[order].T) for values in (directions, light))
    return StarField(directions, irradiance, _cell_middles(), first)


def _cell(directions: FloatArray) -> np.typing.NDArray[np.intp]:
    """Return the cell index (K,) of directions, on a cube map of six faces of ``_SIDE`` squared cells."""
    axis = np.argmax(np.abs(directions), axis=1)
    rows = np.arange(len(directions))
    depth = directions[rows, axis]
    u = directions[rows, (axis + 1) % 3] / np.abs(depth)
    v = directions[rows, (axis + 2) % 3] / np.abs(depth)
    i, k = (np.clip(((w + 1) / 2 * _SIDE).astype(int), 0, _SIDE - 1) for w in (u, v))
    return ((2 * axis + (depth < 0)) * _SIDE + i) * _SIDE + k


def _cell_middles() -> FloatArray:
    face, i, k = np.unravel_index(np.arange(6 * _SIDE * _SIDE), (6, _SIDE, _SIDE))
    axis = face // 2
    d = np.zeros((len(face), 3))
    rows = np.arange(len(face))
    d[rows, axis] = 1 - 2 * (face % 2)
    d[rows, (axis + 1) % 3] = (i + 0.5) / _SIDE * 2 - 1
    d[rows, (axis + 2) % 3] = (k + 0.5) / _SIDE * 2 - 1
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def star_irradiance_w_m2(
    hp_mag: FloatArray, b_minus_v: FloatArray, bands: Bands, v_minus_i: FloatArray | None = None
) -> FloatArray:
    """Return the irradiance per band (K, n) of stars of magnitude Hp and colours B-V and V-I [W m-2].

    Parameters
    ----------
    hp_mag : (n,) array
        Hipparcos magnitudes.
    b_minus_v : (n,) array
        Colour indices B-V.
    bands : Bands
        Spectral bands of the image.
    v_minus_i : array, optional
        Cousins colour, needed for M stars; by default the one that usually goes with ``b_minus_v``.

    Returns
    -------
    (K, n) array
        Irradiance [W m-2].
    """
    bv = np.nan_to_num(np.asarray(b_minus_v, float), nan=_SUN_B_MINUS_V)
    vi = typical_v_minus_i(bv)
    if v_minus_i is not None:
        vi = plausible_v_minus_i(bv, np.asarray(v_minus_i, float))
    return irradiance_of_v_mag(np.asarray(hp_mag, float) - hp_minus_v(bv, vi), bv, vi, bands)
