"""Levels of detail: how finely a craft is built."""

from __future__ import annotations

from dataclasses import dataclass

from flyaround.simulator.targets.model import Detail

COARSER: dict[Detail, int] = {"full": 1, "medium": 2, "low": 4}  # divisor of the number of segments


@dataclass(frozen=True)
class Level:
    """Level of detail, as queries of a builder.

    Parameters
    ----------
    detail : Detail, optional
        ``"full"`` for close views, ``"medium"`` for some tens of metres, ``"low"`` for a few pixels.
    """

    detail: Detail = "full"

    def segments(self, full: int) -> int:
        """Return the facets round an axis: all, two thirds or one third of ``full`` (a multiple of 12).

        Thirds keep the vertices of the lowest level among those of the full one, so that labels that lie
        on rims at multiples of 15 degrees are vertices at every level.
        """
        return {"full": full, "medium": 2 * full // 3, "low": full // 3}[self.detail]

    @property
    def fine(self) -> bool:
        """True if single cells, rails and bolts are built."""
        return self.detail == "full"

    @property
    def fittings(self) -> bool:
        """True if windows, thrusters and antennas are built."""
        return self.detail != "low"


def facets(detail: Detail, full: int) -> int:
    """Return the facets round a curved body: ``full``, half of them at medium, a quarter at low.

    Their number is a multiple of four, so that the points on the axes' sides stay where they are.
    """
    if detail == "full":
        return full
    return min(full, max(4, 4 * round(full / (4 * COARSER[detail]))))
