"""Geocentric positions of Sun and Moon from SOFA's analytic series, which need no data files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import erfa
import numpy as np

from flyaround.simulator.world.constants import AU_M, DAY_S, LIGHT_M_S
from flyaround.simulator.world.time.instant import without_year_warning

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray

_C_AU_DAY = LIGHT_M_S * DAY_S / AU_M


def sun_geometric_m(tt1: ArrayLike, tt2: ArrayLike) -> FloatArray:
    """Return the geometric geocentric position of the Sun, GCRS axes (..., 3) [m], for its attraction.

    Returns
    -------
    (..., 3) array
        Position [m].
    """
    heliocentric, _ = without_year_warning(erfa.epv00, tt1, tt2)
    return np.asarray(-heliocentric["p"] * AU_M, float)


def moon_geometric_m(tt1: ArrayLike, tt2: ArrayLike) -> FloatArray:
    """Return the geometric geocentric position of the Moon, GCRS axes (..., 3) [m], for its attraction."""
    return np.asarray(erfa.moon98(tt1, tt2)["p"] * AU_M, float)


def moon_geometric_state(tt1: float, tt2: float) -> tuple[FloatArray, FloatArray]:
    """Return the geometric geocentric position and velocity of the Moon, GCRS axes, [m] and [m s-1], each (3,)."""
    pv = erfa.moon98(tt1, tt2)
    return np.asarray(pv["p"] * AU_M, float), np.asarray(pv["v"] * (AU_M / DAY_S), float)


def sun_eci_m(tt1: ArrayLike, tt2: ArrayLike) -> FloatArray:
    """Return the apparent geocentric position of the Sun in GCRS [m], with light time and annual aberration.

    A spacecraft's own velocity adds at most 5 arcsec, which is neglected.

    Parameters
    ----------
    tt1 : array_like
        (...) first part of the Julian date of TT (used for TDB: 2 ms, negligible here).
    tt2 : array_like
        (...) second part of this date.

    Returns
    -------
    (..., 3) array
        Direction as seen from the Earth's centre, times the distance that the light has travelled.

    References
    ----------
    SOFA routines ``iauEpv00`` (Earth, 5 km or 0.01 arcsec over 1900-2100) and ``iauAb``.
    """
    heliocentric, barycentric = without_year_warning(erfa.epv00, tt1, tt2)
    sun_p = barycentric["p"] - heliocentric["p"]
    sun_v = barycentric["v"] - heliocentric["v"]
    light_days = np.linalg.norm(heliocentric["p"], axis=-1, keepdims=True) / _C_AU_DAY
    light_path_au = sun_p - sun_v * light_days - barycentric["p"]
    distance_au = np.linalg.norm(light_path_au, axis=-1, keepdims=True)
    beta = barycentric["v"] / _C_AU_DAY
    lorentz = np.sqrt(1 - np.sum(beta * beta, axis=-1))
    apparent = erfa.ab(light_path_au / distance_au, beta, distance_au[..., 0], lorentz)
    return np.asarray(apparent * distance_au * AU_M, float)


def moon_eci_m(tt1: ArrayLike, tt2: ArrayLike) -> FloatArray:
    """Return the apparent geocentric position of the Moon in GCRS [m], corrected for light time.

    For a geocentric observer the light time along the relative motion is the whole planetary aberration.

    Parameters
    ----------
    tt1 : array_like
        (...) first part of the Julian date of TT.
    tt2 : array_like
        (...) second part of this date.

    Returns
    -------
    (..., 3) array
        Position.

    References
    ----------
    SOFA routine ``iauMoon98`` (Meeus 1998: about 10 arcsec, 20 km in distance).
    """
    pv = erfa.moon98(tt1, tt2)
    light_days = np.linalg.norm(pv["p"], axis=-1, keepdims=True) / _C_AU_DAY
    return np.asarray((pv["p"] - pv["v"] * light_days) * AU_M, float)
