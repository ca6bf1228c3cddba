"""Light regime of an image, decided once from its statistics."""

from __future__ import annotations

from enum import Enum


class Regime(Enum):
    """Illumination of an image, which selects search settings and confidence weights.

    In ``SUNLIGHT``, black space has level zero and half of the noise is clipped. ``LAMPS`` illuminate a laboratory,
    whose camera has a black level; images smoothed by compression or filtering resemble laboratory images.
    """

    SUNLIGHT = "sunlight"
    LAMPS = "lamps"

    @staticmethod
    def from_black_level(black: float, *, trained: bool) -> Regime:
        """Return the regime of an image.

        Parameters
        ----------
        black : float
            Black level of the image; 0 if none is measured.
        trained : bool
            True if the target has a network trained on lamp-lit images. The confidence weights of that regime were
            fitted with one; a target without a network is searched as in sunlight.
        """
        return Regime.LAMPS if trained and black > 0 else Regime.SUNLIGHT
