"""Independent checks of keypoint visibility, by ray casting against all triangles, and of the amodal box.

The labels are computed from depths of the projected mesh. Here a ray is cast from each keypoint to the camera and one
to the Sun. A hit means occlusion or shadow.

References
----------
Moeller and Trumbore (1997), Fast, minimum storage ray/triangle intersection.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.check.geometry import PIXEL_TOLERANCE_PX, check_box_by_edges
from flyaround.simulator.dataset.check.row_poses import pose_of_row
from flyaround.simulator.runtime.memory import cached_per_object
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.labels.truth import KeypointLabel, KeypointState, Truth
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target

OCCLUDER_DISTANCE_M = 2e-3  # docs/formats/truth.md: a surface closer to a keypoint than this does not hide it
# tolerances of that distance [m], and of barycentric coordinates: closer to the limit, either state is accepted
DISTANCE_TOLERANCE_M, BARYCENTRIC_TOLERANCE = (
    1e-4,
    1e-6,
)

# Depth above which a keypoint is in front of the camera [m].
MIN_DEPTH_M = 1e-3

# Visible share of the Sun's disc below which a keypoint counts as eclipsed, as in the labels.
ECLIPSE_THRESHOLD = 0.02
IMAGE_STATES = ("visible", "saturated", "below_noise")


class Triangles:
    """All triangles of a craft, target frame, for ray tests."""

    def __init__(self, target: Target) -> None:
        self.vertices_m = np.concatenate([part.positions_m for part in target.parts]).astype(float)
        corners = np.concatenate([part.positions_m[part.triangles] for part in target.parts]).astype(float)
        self._corners = corners
        middle = corners.mean(axis=1)
        self._reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1) + 1e-6
        self._middle = np.ascontiguousarray(middle.T)
        # term of the test against bounding spheres that does not depend on the ray
        self._within = (middle**2).sum(axis=1) - self._reach**2

    def between(self, start_m: FloatArray, direction: FloatArray, length_m: float) -> tuple[bool, bool]:
        """Cast a ray and return whether it certainly hits a triangle, and whether it possibly does.

        Parameters
        ----------
        start_m : (3,) array
            Origin of the ray.
        direction : (3,) array
            Unit direction.
        length_m : float
            Length of the ray; infinite towards the Sun.
        """
        along = direction @ self._middle - direction @ start_m
        near = np.flatnonzero(
            self._within - 2 * (start_m @ self._middle) + start_m @ start_m <= along * along
        )
        reach = self._reach[near]
        near = near[(along[near] >= -reach) & (along[near] <= length_m + reach)]
        a, b, c = self._corners[near].transpose(1, 0, 2)
        e1, e2 = b - a, c - a
        p = np.cross(direction, e2)
        area = (e1 * p).sum(axis=1)
        scale = np.linalg.norm(e1, axis=1) * np.linalg.norm(e2, axis=1)
        can_hide = np.abs(area) > 1e-12 * np.maximum(scale, 1e-30)  # an edge-on triangle hides nothing
        safe = np.where(can_hide, area, 1.0)
        s = start_m - a
        u = (s * p).sum(axis=1) / safe
        q = np.cross(s, e1)
        v = (q @ direction) / safe
        t = (e2 * q).sum(axis=1) / safe
        inside = np.minimum(np.minimum(u, v), 1 - u - v)
        possible_hit = (
            can_hide
            & (inside > -BARYCENTRIC_TOLERANCE)
            & (t > OCCLUDER_DISTANCE_M - DISTANCE_TOLERANCE_M)
            & (t < length_m)
        )
        certain = (
            can_hide
            & (inside > BARYCENTRIC_TOLERANCE)
            & (t > OCCLUDER_DISTANCE_M + DISTANCE_TOLERANCE_M)
            & (t < length_m - OCCLUDER_DISTANCE_M)
        )
        return bool(certain.any()), bool(possible_hit.any())


@cached_per_object
def triangles_of(target: Target) -> Triangles:
    """Return `Triangles`, cached by target."""
    return Triangles(target)


def check_states(truth: Truth, target: Target) -> list[str]:
    """Return faults for keypoints whose geometric state contradicts a ray."""
    mesh = triangles_of(target)
    to_sun = matrix_from_quat(truth.q_camera_from_target_wxyz).T @ np.asarray(truth.sun_direction_camera)
    faults = []
    for keypoint in truth.keypoints:
        if keypoint.state == "out_of_frame" or keypoint.pixel_px is None:
            continue  # this state depends on the pixel alone, which is checked elsewhere
        possible = _possible(truth, keypoint, mesh, to_sun)
        state = "in sight" if keypoint.state in IMAGE_STATES else keypoint.state
        if state not in possible:
            faults.append(
                f"keypoint {keypoint.name} is labelled {keypoint.state}, a ray says {' or '.join(possible)}"
            )
    return faults


def _possible(
    truth: Truth, keypoint: KeypointLabel, mesh: Triangles, to_sun: FloatArray
) -> list[KeypointState | str]:
    """Return the states that the rays allow: one, or two if a ray grazes a triangle."""
    point = np.array(keypoint.target_m)
    row = 0.0 if keypoint.pixel_px is None else keypoint.pixel_px[1]
    eye = np.asarray(pose_of_row(truth, row).inverse().t_m) - point
    distance = float(np.linalg.norm(eye))
    certain, possible_hit = mesh.between(point, eye / distance, distance)
    possible: list[KeypointState | str] = ["self_occluded"] if possible_hit else []
    if certain:
        return possible
    if truth.scene.has_lamps:
        return [*possible, "in sight"]  # lamps at the camera illuminate every point that it sees
    if truth.scene.sunlit_fraction < ECLIPSE_THRESHOLD:
        return [*possible, "eclipsed"]
    certain, possible_hit = mesh.between(point, to_sun, np.inf)
    possible += ["shadowed"] if possible_hit else []
    return possible if certain else [*possible, "in sight"]


def check_amodal_box(truth: Truth, target: Target) -> list[str]:
    """Check the amodal box against the bounds of all vertices, and of all edges if a lens bows them."""
    points = triangles_of(target).vertices_m
    t, R = np.asarray(truth.t_camera_from_target_m), matrix_from_quat(truth.q_camera_from_target_wxyz)
    depth = points @ R[2] + t[2]
    if abs(float(depth.min()) - MIN_DEPTH_M) < 1e-9:
        return []
    is_in_front = bool(depth.min() > MIN_DEPTH_M)
    if is_in_front != (truth.box_amodal_px is not None):
        return [
            f"box_amodal_px is {truth.box_amodal_px}, the craft is {'' if is_in_front else 'not '}all before the camera"
        ]
    if truth.box_amodal_px is None:
        return []
    if not truth.camera.distortion.is_none:
        return check_box_by_edges(truth, joined_mesh(target))
    c = truth.camera
    pixels = ((R[:2] @ points.T + t[:2, None]) / depth).T * (c.fx_px, c.fy_px) + (c.cx_px, c.cy_px)
    expected = (*pixels.min(axis=0), *pixels.max(axis=0))
    error = np.abs(np.subtract(expected, truth.box_amodal_px))
    # far outside the image, coordinates are large and rounding errors grow with them
    if np.any(error > PIXEL_TOLERANCE_PX * np.maximum(1, np.abs(expected) / 1e3)):
        rounded = tuple(round(float(x), 3) for x in expected)
        return [f"box_amodal_px {truth.box_amodal_px} is not the projected craft's {rounded}"]
    return []
