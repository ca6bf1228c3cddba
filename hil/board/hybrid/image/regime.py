"""The light regime of an image, decided once from its statistics; every later stage is handed it."""

from __future__ import annotations

from enum import Enum


class Regime(Enum):
    """The light that an image was taken in: it chooses the network, the search settings and the confidence weights.

    A camera in sunlight adds nothing to black space, and half of its noise is cut off at zero. ``LAMPS`` are those of
    a laboratory, whose camera has a black level; images that a file or a filter has smoothed are like its images.
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
