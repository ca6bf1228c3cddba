"""Random generators by seed and number, and random directions and attitudes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.runtime.arrays import FloatArray


def numbered_generator(seed: int, number: int, stream: int) -> Generator:
    """Create the random generator of a sample in one stream of a seed.

    Returns
    -------
    Generator
        New SFC64 generator. It depends on the three numbers alone; those of other samples and streams are
        independent of it.
    """
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(number, stream))))


def uniform_direction(rng: Generator) -> FloatArray:
    """Draw a direction, uniform on the sphere.

    Returns
    -------
    (3,) array
        Unit vector.
    """
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v), float)


def direction_about_z(rng: Generator, low_deg: float, high_deg: float) -> FloatArray:
    """Draw a direction between two angles from the z axis, uniform in solid angle.

    Returns
    -------
    (3,) array
        Unit vector.
    """
    c = rng.uniform(np.cos(np.radians(high_deg)), np.cos(np.radians(low_deg)))
    azimuth = rng.uniform(0, 2 * np.pi)
    s = np.sqrt(1 - c**2)
    return np.array([s * np.cos(azimuth), s * np.sin(azimuth), c])


def uniform_attitude(rng: Generator) -> FloatArray:
    """Draw an attitude, uniform on SO(3): a normalised vector of four normals (Marsaglia 1972).

    Returns
    -------
    (4,) array
        Unit quaternion, scalar first, ``w >= 0``.
    """
    q = rng.standard_normal(4)
    q /= np.linalg.norm(q)
    return np.asarray(q if q[0] >= 0 else -q, float)
