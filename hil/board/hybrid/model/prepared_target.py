"""Target prepared for one camera: tables that are computed once, before the first image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import CURVED_NORMAL_STEPS, Faces
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.geometry.wireframe import EdgeSamples, OccludingTriangles
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMapTable
from flyaround.hil.board.hybrid.model.view_tables import ViewTable, build_views, is_round, with_outlines
from flyaround.hil.board.hybrid.model.visibility import occluders, sample_edges

Array = np.ndarray

# Samples of an edge as long as the radius; distances of the view tables [radii], one for short and one for long range,
# because perspective changes the shape at short range. Chosen by eye.
SAMPLES_PER_RADIUS = 30.0
TABLE_RADII = (4.5, 14.0)


@dataclass(frozen=True, eq=False)
class PreparedTarget:
    """Precomputed tables of one target for one camera.

    Parameters
    ----------
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.
    samples : EdgeSamples
        Sample points on the wireframe.
    spacing_m : float
        Distance between samples [m].
    occ : OccludingTriangles
        Mesh that occludes the samples.
    tables : tuple of ViewTable
        View tables for short and long range.
    centre_m : (3,) array
        Centre of the bounding sphere, target frame [m].
    radius_m : float
        Radius of the bounding sphere [m].
    suns : ShadowMapTable, optional
        Shadow maps for many Sun directions; None without faces.
    round : bool
        True if much of the outline lies on curved surfaces.
    """

    model: BoardModel
    camera: CameraIntrinsics
    samples: EdgeSamples
    spacing_m: float
    occ: OccludingTriangles
    tables: Tuple[ViewTable, ...]
    centre_m: Array
    radius_m: float
    suns: Optional[ShadowMapTable] = None
    round: bool = False

    @staticmethod
    def prepare(model: BoardModel, camera: CameraIntrinsics) -> PreparedTarget:
        """Compute the tables of a target for a camera.

        Returns
        -------
        PreparedTarget
            Tables of the model; if the target is round, its faces are grouped by coarser normals.
        """
        radius = model.radius_m
        spacing = radius / SAMPLES_PER_RADIUS
        samples, occ = sample_edges(model, spacing), occluders(model)
        tables = tuple(build_views(model, samples, occ, d * radius) for d in TABLE_RADII)
        curved = is_round(model)
        if model.outlines is not None and curved:
            tables = tuple(with_outlines(view, model.outlines, model.centre_m) for view in tables)
        suns = None if model.faces is None else ShadowMapTable.from_faces(model.faces)
        if model.faces is not None and curved:
            model = replace(model, faces=model.faces.grouped(CURVED_NORMAL_STEPS))
        centre = model.centre_m
        return PreparedTarget(model, camera, samples, spacing, occ, tables, centre, radius, suns, curved)


def faces_of(target: PreparedTarget) -> Faces:
    """Return the faces of a target that has faces."""
    faces = target.model.faces
    assert faces is not None  # noqa: S101 - guaranteed by the caller
    return faces
