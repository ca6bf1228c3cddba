"""The light regime of an image, decided once from its statistics."""

from __future__ import annotations

from enum import Enum


class Regime(Enum):
    """Light that an image was taken in, which chooses search settings and confidence weights.

    In ``SUNLIGHT`` black space has level zero, and half of the noise is cut off. ``LAMPS`` are those of a laboratory,
    whose camera has a black level; images smoothed by compression or a filter resemble its images.
    """

    SUNLIGHT = "sunlight"
    LAMPS = "lamps"

    @staticmethod
    def of(black: float, *, trained: bool) -> Regime:
        """Return the regime of an image.

        Parameters
        ----------
        black : float
            Level of black in the image, 0 where nothing lifts it above zero.
        trained : bool
            True if the target has a network that was trained in the light of lamps. The confidence weights of that
            light were fitted to it; a target without one is searched as in sunlight.
        """
        return Regime.LAMPS if trained and black > 0 else Regime.SUNLIGHT
