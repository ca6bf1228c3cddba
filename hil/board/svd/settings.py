"""Settings of the two published variants: their stages and differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

STREAMS = ("wge", "sh", "lsd", "ellipse", "harris")
SOLVERS = ("epnp", "p3p", "ap3p", "sqpnp", "iterative", "ippe")


@dataclass(frozen=True)
class PublishedConfig:
    """Settings of one published variant.

    Parameters
    ----------
    name : str
        Name of the method.
    streams : tuple of str
        Feature streams, of ``STREAMS``: lines from three detectors, ellipses of round bodies, corner points.
    solver : str
        Pose solver, of ``SOLVERS``.
    ransac : bool
        Solve three random points of a group and rank by inliers, instead of all points and the reprojection error.
    roi_growth : float
        Enlargement of the region of interest [share of the mean edge length].
    least_component : float
        Smallest connected component of the Sobel edges [share of the region's diagonal]; 0 keeps all.
    merge_each : tuple of str
        Streams that are merged separately before all are merged.
    top : int
        Number of poses that are refined.

    Raises
    ------
    ValueError
        If a stream or the solver is unknown, a share is negative or not finite, or ``top`` is not positive.
    """

    name: str
    streams: Tuple[str, ...] = ("wge", "sh")
    solver: str = "epnp"
    ransac: bool = False
    roi_growth: float = 0.0
    least_component: float = 0.0
    merge_each: Tuple[str, ...] = ("sh",)
    top: int = 5

    def __post_init__(self) -> None:
        """Check the names and the shares."""
        unknown = [name for name in (*self.streams, *self.merge_each) if name not in STREAMS]
        if unknown or self.solver not in SOLVERS:
            raise ValueError(
                f"{self.name}: unknown stream or solver {(unknown or [self.solver])[0]!r}, allowed: "
                f"{', '.join(STREAMS)}; {', '.join(SOLVERS)}"
            )
        if (
            not all(0 <= share < float("inf") for share in (self.roi_growth, self.least_component))
            or self.top < 1
        ):
            raise ValueError(f"{self.name}: shares must be finite and not negative, top at least 1")


SVD_2018 = PublishedConfig("svd-2018")
SVD_THESIS = PublishedConfig(
    "svd-thesis",
    solver="p3p",
    ransac=True,
    roi_growth=0.05,
    least_component=0.04,
    merge_each=("wge", "sh"),
)
