"""The switches of the published methods: each difference between them, and each step from them to ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Tuple

STREAMS = ("wge", "sh", "lsd", "ellipse", "harris")
SOLVERS = ("epnp", "p3p", "ap3p", "sqpnp", "iterative", "ippe")


@dataclass(frozen=True)
class PublishedConfig:
    """One published method, or a step from one towards ours.

    Parameters
    ----------
    name : of the method.
    streams : of ``STREAMS``; straight lines, ellipses of round bodies, corner points.
    solver : of ``SOLVERS``. ransac : three points of a figure at random and inliers counted, rather than all of its
        points and reprojection error.
    roi_growth : enlargement of the region, share of the mean edge length.
    least_component : components of the Sobel picture with fewer pixels are removed, share of the region's
        diagonal; 0 keeps all.
    merge_each : streams merged by themselves before all are merged together.
    top : poses refined.
    regions : ``cdf`` (published) or ``proposed`` (ours: several).
    rank : ``corners`` (published: reprojection error of corners) or ``edges`` (ours: support of the whole model).
    finish : ``corners`` (published: Gauss-Newton on corners) or ``edges`` (ours: sub-pixel on all visible edges).
    """

    name: str
    streams: Tuple[str, ...] = ("wge", "sh")
    solver: str = "epnp"
    ransac: bool = False
    roi_growth: float = 0.0
    least_component: float = 0.0
    merge_each: Tuple[str, ...] = ("sh",)
    top: int = 5
    regions: str = "cdf"
    rank: str = "corners"
    finish: str = "corners"


# What the thesis's version has and the published one has not.
OF_THESIS: Dict[str, Dict[str, Any]] = {
    "grow": {"roi_growth": 0.05},
    "clean": {"least_component": 0.04},
    "merge-each": {"merge_each": ("wge", "sh")},
    "ransac": {"solver": "p3p", "ransac": True},
}

# What a published method can take over from ours.
OF_OURS: Dict[str, Dict[str, Any]] = {
    "lsd": {"streams": ("wge", "sh", "lsd")},
    "regions": {"regions": "proposed"},
    "many": {"top": 50},
    "edge-rank": {"rank": "edges"},
    "edge-finish": {"finish": "edges"},
}

# Steps away from a published method, each alone or several: what the ablation takes.
STEPS: Dict[str, Dict[str, Any]] = {**OF_THESIS, **OF_OURS}

SVD_2018 = PublishedConfig("svd-2018")
SVD_THESIS = PublishedConfig(
    "svd-thesis",
    solver="p3p",
    ransac=True,
    roi_growth=0.05,
    least_component=0.04,
    merge_each=("wge", "sh"),
)
