"""The Earth's gravity in fully normalised spherical harmonics: EGM96 to any degree up to 70."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

ComplexArray = NDArray[np.complex128]

MAX_DEGREE = 70  # of the shipped coefficients, assets/gravity/EGM96_to70.gfc


@dataclass(frozen=True, eq=False)
class HarmonicField:
    """All terms of degree 2 to ``degree`` of a gravity field, without the point mass.

    The potential is the real part of a sum over ``(C - iS) Z``, with the solid harmonics
    ``Z_nm = (R/r)^(n+1) P_nm(sin latitude) exp(i m longitude)``. Their Cartesian derivatives are single
    harmonics of the next degree, so the acceleration is one product of a constant table with all ``Z``, and
    nothing is singular at the poles.

    Parameters
    ----------
    degree : int
        Highest degree and order.
    mu_m3_s2 : float
        Gravitational parameter of the coefficients.
    radius_m : float
        Reference radius of the coefficients.
    vertical : array
        (degree + 2, degree + 2) factors of the recursion over degrees, for degree n - 1.
    lower : array
        The same factors for degree n - 2.
    sectoral : array
        (degree + 2,) running product that starts each order.
    table : array
        (3, (degree + 2)^2) coefficients of x, y, z acceleration [m s-2].

    References
    ----------
    Cunningham (1970), Celestial Mechanics 2, 207; Montenbruck & Gill (2000), Satellite Orbits;
    recursion of normalised functions: Holmes & Featherstone (2002), J. Geodesy 76, 279, eq. 11.
    """

    degree: int
    mu_m3_s2: float
    radius_m: float
    vertical: FloatArray
    lower: FloatArray
    sectoral: FloatArray
    table: ComplexArray

    def acceleration(self, r_itrs_m: FloatArray) -> FloatArray:
        """Return the accelerations at (k, 3) Earth-fixed positions, along Earth-fixed axes: (k, 3) [m s-2]."""
        Z = self._harmonics(r_itrs_m)
        return np.asarray((self.table @ Z.reshape(-1, len(r_itrs_m))).real.T)

    def _harmonics(self, r_itrs_m: FloatArray) -> ComplexArray:
        """Return the normalised solid harmonics, (degree + 2, degree + 2, k).

        The Legendre functions, divided by ``cos(latitude)^m``, follow degree by degree for all orders at once;
        ``exp(i m longitude) cos(latitude)^m`` and ``(R/r)^(n+1)`` are powers.
        """
        size, k = self.degree + 2, len(r_itrs_m)
        r = np.sqrt(np.einsum("ij,ij->i", r_itrs_m, r_itrs_m))
        x, y, sine = (r_itrs_m / r[:, None]).T
        legendre = np.zeros((size, size, k))
        legendre[self._orders, self._orders] = self.sectoral[:, None]
        weights = self._weights[..., None] * np.array([np.ones(k), sine])[:, None, None]
        # order 0 of degree 1 has no degree below its own
        legendre[1, :1] = weights[1, 1, :1] * legendre[0, :1]
        multiply, add = np.multiply, np.add.reduce
        for n in range(2, size):
            add(multiply(weights[:, n, :n], legendre[n - 2 : n, :n]), axis=0, out=legendre[n, :n])
        azimuthal = np.empty((size, k), complex)
        azimuthal[0] = 1.0
        azimuthal[1:] = x + 1j * y
        np.cumprod(azimuthal, axis=0, out=azimuthal)
        legendre *= ((self.radius_m / r) ** (self._orders[:, None] + 1))[:, None]
        return np.asarray(legendre * azimuthal)

    @cached_property
    def _weights(self) -> FloatArray:
        """Recursion weights (2, size, size) of degrees n - 2 and n - 1; the latter are times sin(latitude)."""
        return np.stack([-self.lower, self.vertical])

    @cached_property
    def _orders(self) -> NDArray[np.int64]:
        return np.arange(self.degree + 2)


@lru_cache(maxsize=8)
def egm96(degree: int) -> HarmonicField:
    """Load EGM96 (tide free) to ``degree`` and order.

    Returns
    -------
    HarmonicField
        Gravity of degrees 2 and up, without the point mass; cached, so do not modify it.

    Raises
    ------
    ValueError
        If the degree is not 2 to 70.

    References
    ----------
    Lemoine et al. (1998), NASA/TP-1998-206861; coefficients in the ICGEM file ``assets/gravity``.
    """
    if not 2 <= degree <= MAX_DEGREE:
        raise ValueError(f"degree {degree} is not one of 2 to {MAX_DEGREE}, which the coefficients reach")
    mu, radius, C, S = _coefficients()
    return harmonic_field(mu, radius, C[: degree + 1, : degree + 1], S[: degree + 1, : degree + 1])


def harmonic_field(mu_m3_s2: float, radius_m: float, C: FloatArray, S: FloatArray) -> HarmonicField:
    """Build a field from (degree + 1, degree + 1) normalised coefficients; those below degree 2 are ignored."""
    degree = len(C) - 1
    size = degree + 2
    n, m = np.meshgrid(np.arange(size, dtype=float), np.arange(size, dtype=float), indexing="ij")
    inner = m < n
    with np.errstate(divide="ignore", invalid="ignore"):
        vertical = np.where(inner, np.sqrt((4 * n**2 - 1) / (n**2 - m**2)), 0.0)
        ratio = np.sqrt(((n - 1) ** 2 - m**2) / (4 * (n - 1) ** 2 - 1))
        lower = np.where(m < n - 1, vertical * np.nan_to_num(ratio), 0.0)
    orders = np.arange(1, size, dtype=float)
    growth = np.sqrt((2 * orders + 1) / (2 * orders))
    growth[0] = np.sqrt(3.0)
    return HarmonicField(
        degree=degree,
        mu_m3_s2=mu_m3_s2,
        radius_m=radius_m,
        vertical=vertical,
        lower=lower,
        sectoral=np.concatenate([[1.0], np.cumprod(growth)]),
        table=_derivative_table(C, S) * (mu_m3_s2 / radius_m**2),
    )


def _derivative_table(C: FloatArray, S: FloatArray) -> ComplexArray:
    """Return the weight of every harmonic in the gradient of the potential (3, size^2), for GM = R = 1.

    ``R (d/dx +- i d/dy)`` and ``R d/dz`` of ``Z_nm`` are the harmonics of degree n + 1 and order m +- 1, m.
    """
    size = len(C) + 1
    table = np.zeros((3, size, size), complex)
    for n in range(2, size - 1):
        for m in range(n + 1):
            c = complex(C[n, m], -S[n, m])
            scale = (2 * n + 1) / (2 * n + 3)
            up = np.sqrt((0.5 if m == 0 else 1.0) * scale * (n + m + 2) * (n + m + 1))
            table[2, n + 1, m] -= c * np.sqrt(scale * (n + m + 1) * (n - m + 1))
            if m == 0:
                # the real zonal harmonic: both of its horizontal derivatives come from order 1
                table[0, n + 1, 1] -= c * up
                table[1, n + 1, 1] += 1j * c * up
                continue
            down = np.sqrt((2.0 if m == 1 else 1.0) * scale * (n - m + 2) * (n - m + 1))
            table[0, n + 1, m + 1] -= 0.5 * c * up
            table[0, n + 1, m - 1] += 0.5 * c * down
            table[1, n + 1, m + 1] += 0.5j * c * up
            table[1, n + 1, m - 1] += 0.5j * c * down
    return table.reshape(3, -1)


@lru_cache(maxsize=1)
def _coefficients() -> tuple[float, float, FloatArray, FloatArray]:
    """Return GM, radius and the normalised C and S of the shipped file."""
    mu = radius = 0.0
    C = np.zeros((MAX_DEGREE + 1, MAX_DEGREE + 1))
    S = np.zeros_like(C)
    text = files("flyaround.assets").joinpath("gravity", "EGM96_to70.gfc").read_text(encoding="utf-8")
    for line in text.splitlines():
        match line.split():
            case ["earth_gravity_constant", value]:
                mu = float(value)
            case ["radius", value]:
                radius = float(value)
            case ["gfc", n, m, c, s, *_]:
                C[int(n), int(m)], S[int(n), int(m)] = float(c), float(s)
    return mu, radius, C, S
