"""Comparison with a folder of reference images: statistics of each image and of a similar rendered view."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.compare.image_statistics import (
    MAX_GRADIENT_DN,
    binary_edges,
    edge_threshold,
    histogram_distance_dn,
    image_statistics,
)
from flyaround.simulator.compare.similar_view import PoseEstimate, find_similar_view, matched_exposure
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from flyaround.simulator.scene.environments import ENVIRONMENTS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from flyaround.simulator.compare.image_statistics import ImageStatistics
    from flyaround.simulator.compare.references import Reference
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

    PoseFinder = Callable[[Reference], PoseEstimate | None]

ATMOSPHERES = {
    "100 km": ENVIRONMENTS["full"],
    "25 km": ENVIRONMENTS["thesis"],
    "none": ENVIRONMENTS["airless"],
}
"""The atmospheres for the comparison of binary edges: ours, that of the Milan thesis, none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pair:
    """A reference and our image of a similar view.

    Parameters
    ----------
    reference : Reference
        The reference image.
    scene : SceneState
        Scene of our image.
    image : (H, W) uint8 array
        Our image.
    theirs : ImageStatistics
        Statistics of the reference.
    ours : ImageStatistics
        Statistics of our image.
    edges : dict
        Binary edges of our image for each atmosphere, all at one threshold; only one entry against space.
    histogram_moved_dn : float
        Earth mover's distance of the histograms [DN].
    gradient_moved_dn : float
        Earth mover's distance of the gradient histograms [DN per pixel].
    same_view : bool
        True if our image has the pose of the reference, and not only a similar view.
    likeness : float or None
        Correlation over the craft's box; None without a common pose.
    """

    reference: Reference
    scene: SceneState
    image: ByteArray
    theirs: ImageStatistics
    ours: ImageStatistics
    edges: dict[str, NDArray[np.bool_]]
    histogram_moved_dn: float
    gradient_moved_dn: float
    same_view: bool
    likeness: float | None

    def document(self) -> dict[str, Any]:
        """Return the figures as a JSON-able object."""
        return {
            "picture": self.reference.path.name,
            "same_view": self.same_view,
            "likeness": None if self.likeness is None else round(self.likeness, 4),
            "reference": self.theirs.document(),
            "ours": self.ours.document(),
            "histogram_moved_dn": round(self.histogram_moved_dn, 3),
            "gradient_moved_dn": round(self.gradient_moved_dn, 4),
            "edges_by_atmosphere": {name: round(float(e.mean()), 5) for name, e in self.edges.items()},
        }


def compare_pictures(
    renderer: Renderer,
    references: Sequence[Reference],
    target: Target,
    find_pose: PoseFinder,
    *,
    sensor: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Pair]:
    """Render a similar view of every reference image, and measure both.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    references : sequence of Reference
        Reference images.
    target : Target
        Target model.
    find_pose : PoseFinder
        Estimator that returns the pose of the craft in an image without a record.
    sensor : str, optional
        Preset for our images; by default, one as noisy as the reference.
    progress : callable, optional
        Called with the number of finished images, and the total.

    Returns
    -------
    list of Pair
        Measures of each reference and of our image.
    """
    pairs = []
    for k, reference in enumerate(references):
        estimate = find_pose(reference) if reference.pose is None else PoseEstimate(reference.pose, sure=True)
        like = find_similar_view(renderer, reference, target, estimate, sensor=sensor)
        radiance = renderer.render(like.scene, target).radiance
        scene = matched_exposure(like.scene, radiance, reference.image)
        image = _picture(scene, radiance)
        theirs, ours = image_statistics(reference.image), image_statistics(image)
        pairs.append(
            Pair(
                reference=reference,
                scene=scene,
                image=image,
                theirs=theirs,
                ours=ours,
                edges=edges_by_atmosphere(renderer, scene, target, image),
                histogram_moved_dn=histogram_distance_dn(theirs.histogram, ours.histogram, 256.0),
                gradient_moved_dn=histogram_distance_dn(
                    theirs.gradient_histogram, ours.gradient_histogram, MAX_GRADIENT_DN
                ),
                same_view=like.same_view,
                likeness=like.likeness,
            )
        )
        if progress is not None:
            progress(k + 1, len(references))
    return pairs


def edges_by_atmosphere(
    renderer: Renderer, scene: SceneState, target: Target, image: ByteArray
) -> dict[str, NDArray[np.bool_]]:
    """Return binary edges of the scene under each of `ATMOSPHERES`, other settings equal; only one against space.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    image : array
        The scene's image under its own atmosphere, which sets the threshold.
    """
    threshold = edge_threshold(image)
    if image_statistics(image).space:
        return {"100 km": binary_edges(image, threshold)}
    edges = {}
    for name, air in ATMOSPHERES.items():
        aired = replace(scene, environment=air)
        edges[name] = binary_edges(_picture(aired, renderer.render(aired, target).radiance), threshold)
    return edges


def summary(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Return medians of references and ours, by background."""
    result: dict[str, Any] = {}
    for space, name in ((True, "space"), (False, "earth")):
        selected = [p for p in pairs if p.theirs.space == space]
        if not selected:
            continue
        rows = {
            side: [
                {k: v for k, v in getattr(p, look).document().items() if not isinstance(v, str)}
                for p in selected
            ]
            for side, look in (("reference", "theirs"), ("ours", "ours"))
        }
        result[name] = {
            "pictures": len(selected),
            "same_view": sum(p.same_view for p in selected),
            **{
                side: {k: round(float(np.median([r[k] for r in documents])), 5) for k in documents[0]}
                for side, documents in rows.items()
            },
            "histogram_moved_dn": round(float(np.median([p.histogram_moved_dn for p in selected])), 3),
            "gradient_moved_dn": round(float(np.median([p.gradient_moved_dn for p in selected])), 4),
        }
    return result


def _picture(scene: SceneState, radiance: NDArray[np.float32]) -> ByteArray:
    signal = expose_scene(scene, radiance)
    return np.asarray(digitise_scene(scene, signal) >> (scene.sensor.bits - 8), np.uint8)
