"""Table of Earth orientation, Sun and Moon over a flight, from which the integrator interpolates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import erfa
import numpy as np

from flyaround.simulator.world.constants import DAY_S
from flyaround.simulator.world.ephemeris.earth_orientation import celestial_and_polar
from flyaround.simulator.world.ephemeris.sun_moon import moon_geometric_m, sun_geometric_m

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

_STEP_S = 1800.0
"""Node spacing [s]; the error of cubic interpolation is then 1 mm for the Moon and 1e-15 rad for nutation."""


@dataclass(frozen=True, eq=False)
class EphemerisTable:
    """Piecewise cubics of Earth orientation, Sun and Moon over a flight.

    Parameters
    ----------
    pieces : (k, 4, 16) array
        Coefficients, highest power first, of the rotation matrix from GCRS to CIRS (9), the Earth rotation angle minus
        a uniform rotation (1), and the geometric positions of Sun (3) and Moon (3) [m].
    era_start_rad : float
        Angle of the uniform rotation at the epoch.
    era_rate_rad_s : float
        Rate of the uniform rotation.
    R_itrs_from_tirs : (3, 3) array
        Polar motion, taken as constant over the flight.
    """

    pieces: FloatArray
    era_start_rad: float
    era_rate_rad_s: float
    R_itrs_from_tirs: FloatArray

    @staticmethod
    def build(epoch: Instant, duration_s: float) -> EphemerisTable:
        """Compute the table for a flight.

        Returns
        -------
        EphemerisTable
            Table whose nodes run from an hour before ``epoch`` to at least an hour and a half after the end of the
            flight. Its times are seconds since ``epoch``.
        """
        nodes = np.arange(-2, int(np.ceil(duration_s / _STEP_S)) + 4) * _STEP_S
        from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to import

        instants = [epoch.plus(float(t)) for t in nodes]
        celestial = np.array([celestial_and_polar(i)[0].ravel() for i in instants])
        era = np.unwrap([float(erfa.era00(*i.ut1)) for i in instants])
        # nodes are less than half a rotation apart, so that unwrapping is unambiguous
        rate = float(era[-1] - era[0]) / float(nodes[-1] - nodes[0])
        start = float(era[0] - rate * nodes[0])
        tt2 = epoch.tt2 + nodes / DAY_S
        columns = np.column_stack(
            [
                celestial,
                era - start - rate * nodes,
                sun_geometric_m(epoch.tt1, tt2),
                moon_geometric_m(epoch.tt1, tt2),
            ]
        )
        pieces = np.ascontiguousarray(CubicSpline(nodes, columns).c.transpose(1, 0, 2))
        return EphemerisTable(pieces, start, rate, celestial_and_polar(epoch)[1])

    def _row(self, t_s: float) -> FloatArray:
        since_start = t_s + 2 * _STEP_S
        k = min(max(int(since_start // _STEP_S), 0), len(self.pieces) - 1)
        t = since_start - k * _STEP_S
        return np.asarray(np.array([t * t * t, t * t, t, 1.0]) @ self.pieces[k])

    def at(self, t_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Interpolate the table.

        Parameters
        ----------
        t_s : float
            Time since the epoch [s].

        Returns
        -------
        R_itrs_from_eci : (3, 3) array
            Earth orientation.
        r_sun_m : (3,) array
            Geometric geocentric position of the Sun, GCRS [m].
        r_moon_m : (3,) array
            Geometric geocentric position of the Moon, GCRS [m].
        """
        row = self._row(t_s)
        angle = self.era_start_rad + self.era_rate_rad_s * t_s + row[9]
        c, s = np.cos(angle), np.sin(angle)
        R_tirs_from_cirs = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        R = self.R_itrs_from_tirs @ (R_tirs_from_cirs @ row[:9].reshape(3, 3))
        return R, row[10:13], row[13:16]
