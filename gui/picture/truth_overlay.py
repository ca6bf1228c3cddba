"""Ground-truth overlay, in pixels of the picture: keypoints with their visibility, box, axes, wireframe."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.gui.picture.label_placement import pixel_of
from flyaround.simulator.labels.boxes import amodal_box
from flyaround.simulator.labels.overlay import edge_points
from flyaround.simulator.labels.visibility import hidden_from_direction, occluded_from_camera
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.world.frames.rotation import rotation_angle_rad

if TYPE_CHECKING:
    from flyaround.gui.picture.view_settings import Overlays
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import BoolArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

Seen = Literal["visible", "shadowed", "hidden"]
Pixel = tuple[float, float]
Segment = tuple[Pixel, Pixel]
AXIS_M = 0.5
"""Length of the drawn target axes."""
NEAR_M = 0.05
ECLIPSE_THRESHOLD = 0.02  # visible share of the Sun
CHANGED_RAD = float(np.radians(2.0))  # change of view after which occlusion is computed again


@dataclass(frozen=True)
class Marks:
    """All marks over one picture; empty ones were not requested.

    Parameters
    ----------
    keypoints : tuple of tuple of Pixel, Seen and str, optional
        Pixel, visibility, name.
    box : tuple of float, optional
        X0 y0 x1 y1 of the whole target at pixel edges.
    axes : tuple of Segment, optional
        Origin and tip of the target's x, y, z axes.
    wireframe : tuple of Segment, optional
        Edges with a face towards the camera.
    """

    keypoints: tuple[tuple[Pixel, Seen, str], ...] = ()
    box: tuple[float, float, float, float] | None = None
    axes: tuple[Segment, ...] = ()
    wireframe: tuple[Segment, ...] = ()


class Marker:
    """Generator of the marks of successive pictures.

    Positions of keypoints are computed for every picture. Occlusion by the craft is expensive, because it needs the
    whole mesh: it is updated only if the view has changed by `CHANGED_RAD`, or if exact visibility is requested.

    Parameters
    ----------
    target : Target
        Model of the target.
    """

    def __init__(self, target: Target) -> None:
        self._target = target
        self._mesh = joined_mesh(target)
        self._points_m = np.array([k.position_m for k in target.keypoints], float).reshape(-1, 3)
        self._asked: SceneState | None = None
        self._seen: tuple[Seen, ...] = ()

    def marks(self, scene: SceneState, overlays: Overlays, *, exact: bool = False) -> Marks:
        """Return the marks of a picture.

        Parameters
        ----------
        scene : SceneState
            Scene of the picture.
        overlays : Overlays
            Requested marks.
        exact : bool, optional
            True to compute occlusion for this picture even if the view has hardly changed.
        """
        pose = scene.camera_from_target
        return Marks(
            keypoints=self._keypoints(scene, exact=exact) if overlays.keypoints else (),
            box=amodal_box(scene, self._target) if overlays.box else None,
            axes=_axes(scene) if overlays.axes else (),
            wireframe=wireframe_at(scene.camera, pose, self._target) if overlays.wireframe else (),
        )

    def _keypoints(self, scene: SceneState, *, exact: bool) -> tuple[tuple[Pixel, Seen, str], ...]:
        in_camera = scene.camera_from_target.apply(self._points_m)
        pixels = scene.camera.project(in_camera)
        in_picture = (in_camera[:, 2] > NEAR_M) & scene.camera.contains(pixels)
        if self._asked is None or (scene != self._asked if exact else _view_changed(scene, self._asked)):
            self._asked, self._seen = scene, self._ask(scene, in_camera[:, 2] > NEAR_M)
        names, there = [k.name for k in self._target.keypoints], np.flatnonzero(in_picture)
        return tuple((pixel_of(pixels[k]), self._seen[k], names[k]) for k in there)

    def _ask(self, scene: SceneState, front: BoolArray) -> tuple[Seen, ...]:
        """Return the geometric visibility of keypoints; radiometric states would need a noise-free image."""
        pose = scene.camera_from_target
        occluded = np.ones(len(self._points_m), bool)
        occluded[front] = occluded_from_camera(self._mesh, self._points_m[front], pose)
        dark = np.ones(len(self._points_m), bool)
        if scene.sun_visible_fraction >= ECLIPSE_THRESHOLD:
            to_sun = pose.R.T @ np.asarray(scene.sun_direction_camera)
            dark = hidden_from_direction(self._mesh, self._points_m, to_sun)
        return tuple(
            "hidden" if is_occluded else "shadowed" if is_dark else "visible"
            for is_occluded, is_dark in zip(occluded, dark, strict=True)
        )


def _view_changed(a: SceneState, b: SceneState) -> bool:
    rotation_rad = rotation_angle_rad(a.q_camera_from_target_wxyz, b.q_camera_from_target_wxyz)
    t_a, t_b = np.array(a.t_camera_from_target_m), np.array(b.t_camera_from_target_m)
    shift = float(np.linalg.norm(t_a - t_b)) / max(float(np.linalg.norm(t_a)), 1e-3)
    sun = float(np.linalg.norm(np.subtract(a.sun_direction_camera, b.sun_direction_camera)))
    eclipsed = (a.sun_visible_fraction < ECLIPSE_THRESHOLD) != (b.sun_visible_fraction < ECLIPSE_THRESHOLD)
    return eclipsed or max(rotation_rad, shift, sun) > CHANGED_RAD


def _axes(scene: SceneState) -> tuple[Segment, ...]:
    ends = scene.camera_from_target.apply(np.vstack([np.zeros(3), AXIS_M * np.eye(3)]))
    if ends[:, 2].min() < NEAR_M:
        return ()
    pixels = scene.camera.project(ends)
    return tuple((pixel_of(pixels[0]), pixel_of(pixels[k])) for k in (1, 2, 3))


def wireframe_at(camera: Camera, pose: Pose, target: Target) -> tuple[Segment, ...]:
    """Return the edges of the target that face the camera, at a pose; under a lens each is a chain of segments."""
    ends = np.array([(e.a_m, e.b_m) for e in target.wireframe], float).reshape(-1, 2, 3)
    eye = pose.inverse().t_m
    share = np.linspace(0.0, 1.0, edge_points(camera))[:, None]
    in_camera = pose.apply(ends[:, :1] + share * (ends[:, 1:] - ends[:, :1]))
    pixels = camera.project(in_camera)
    segments: list[Segment] = []
    for k, edge in enumerate(target.wireframe):
        if in_camera[k, :, 2].min() < NEAR_M:
            continue
        towards = np.asarray(eye) - ends[k].mean(axis=0)
        if edge.normals and max(float(np.dot(n, towards)) for n in edge.normals) <= 0:
            continue
        segments += itertools.pairwise(map(pixel_of, pixels[k]))
    return tuple(segments)
