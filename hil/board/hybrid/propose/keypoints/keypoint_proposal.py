"""Pose proposals of the keypoint network for the regions of an image.

A first pass corrects the position and size of each region's crop, and a second one scores it. The modes of the pose
likelihood in the best crops are proposed.

References
----------
Park, Sharma & D'Amico (2019), Towards robust learning-based pose estimation of noncooperative spacecraft.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Dict, List, Optional, Sequence

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.propose.keypoints.image_crop import ImageCrop, network_inputs
from flyaround.hil.board.hybrid.propose.keypoints.network import KeypointNetwork, network_for
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL
from flyaround.hil.board.hybrid.propose.keypoints.pose_search import (
    LIKELIHOOD_DIVISOR,
    likelihood_table,
    log_likelihoods,
    most_likely_position,
    pose_modes,
    with_outliers,
)
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray

# Diameter of the bounding sphere over the diagonal of a region; the same for sources that often detect a part only.
SPHERE_OVER_BOX, SPHERE_OVER_PART, PART_SOURCES = 1.15, 1.7, ("saliency", "straight")
# Poses proposed per crop, and the number of rolled crops that the second round averages.
POSES_PER_CROP, ROLLS = 16, 4
# Largest deficit of a crop's presence logit relative to the best one, and logit above which no further region is tried
# (docs/lab/2026-11-keypoint-network.md).
MAX_LOGIT_DEFICIT, SURE_LOGIT = 5.0, 10.0
# Largest number of passes, crops in the second pass, and correction below which there is no further pass [sphere
# diameters].
MAX_PASSES, SECOND_PASS_CROPS, CONVERGED = 3, 3, 0.06
# Largest correction in one pass: shift [half sides], log size.
MAX_SHIFT, MAX_LOG_SIZE = 0.9, 0.9


@dataclass(frozen=True, eq=False)
class LearnedProposal:
    """Poses proposed for one crop.

    Parameters
    ----------
    source : Region
        Region that the crop started from.
    crop : ImageCrop
        Corrected crop.
    q : (N, 4) array
        Attitude quaternions, camera from target, in the order of `PoseModes`; the first one is the most likely.
    t : (N, 3) array
        Target positions, camera frame [m].
    log_likelihood : (N,) array
        Log-likelihoods of the poses.
    craft : float
        Logit of the target's presence.
    p : (K, 2, BINS) array
        Keypoint distributions along columns and rows.
    log_size : float
        Logarithm of the target's size over the size that the crop assumes.
    """

    source: Region
    crop: ImageCrop
    q: Array
    t: Array
    log_likelihood: Array
    craft: float
    p: Array
    log_size: float

    @cached_property
    def table(self) -> Array:
        """Log-probabilities (K, 2, BINS), smoothed to the angular spacing of the attitude grid."""
        return likelihood_table(self.p)

    def region(self, camera: CameraIntrinsics) -> Region:
        """Return the square around the bounding sphere of the corrected crop.

        Returns
        -------
        Region
            Square in image pixels, of source ``learned``; it may extend beyond the image.
        """
        u, v = camera.pixels(self.crop.direction)
        r = 0.5 * self.crop.diameter_px
        return Region(float(u - r), float(v - r), float(u + r), float(v + r), "learned")


@dataclass(frozen=True, eq=False)
class LearnedProposer:
    """Keypoint network of a target, for images of one camera.

    Parameters
    ----------
    network : KeypointNetwork
        Trunk and head.
    camera : CameraIntrinsics
        Intrinsics of the camera.
    centre_m : (3,) array
        Centre of the bounding sphere, target frame [m].
    radius_m : float
        Radius of the bounding sphere [m].
    """

    network: KeypointNetwork
    camera: CameraIntrinsics
    centre_m: Array
    radius_m: float

    @staticmethod
    def prepare(model: BoardModel, camera: CameraIntrinsics) -> Optional[LearnedProposer]:
        """Return the proposer of a target; None if no network was trained for it or the model has no faces."""
        network = network_for(model)
        if network is None or model.faces is None:
            return None
        return LearnedProposer(network, camera, model.centre_m, model.radius_m)

    @property
    def points(self) -> Array:
        """Keypoints (K, 3) relative to the sphere's centre [radii]."""
        return np.asarray((self.network.head.keypoints_m - self.centre_m) / self.radius_m)

    def propose(
        self,
        image: Array,
        noise: float,
        regions: Sequence[Region],
        reduced: Optional[Array] = None,
        black: float = 0.0,
    ) -> Optional[LearnedProposal]:
        """Return the proposal for the crop of the regions that most likely shows the target; None without regions.

        Parameters
        ----------
        image : (H, W) array
            The image.
        noise : float
            Standard deviation of the image noise.
        regions : sequence of Region
            Regions that may contain the target.
        reduced : (h, w) array, optional
            Image reduced by area averaging.
        black : float
            Black level.
        """
        if not regions:
            return None
        camera = self.camera
        starts = {
            k: ImageCrop.at(
                camera,
                0.5 * (r.x0 + r.x1),
                0.5 * (r.y0 + r.y1),
                (SPHERE_OVER_PART if r.source in PART_SOURCES else SPHERE_OVER_BOX) * r.diagonal_px,
            )
            for k, r in enumerate(regions)
        }
        distinct = self._distinct(list(starts), starts, len(starts))
        crops, sources = [starts[k] for k in distinct], [regions[k] for k in distinct]
        for pass_index in range(MAX_PASSES):
            outputs = []
            for crop in crops:
                outputs.append(self.network(network_inputs(image, noise, camera, [crop], reduced, black)))
                if not pass_index and outputs[-1][1][0] > SURE_LOGIT:
                    break
            log_p, craft, size = (np.concatenate(parts) for parts in zip(*outputs))  # noqa: B905 - Python 3.9 has no strict=
            selected = [int(k) for k in np.argsort(-craft) if craft[k] >= craft.max() - MAX_LOGIT_DEFICIT]
            corrected = {k: self._correct_crop(crops[k], log_p[k], size[k]) for k in selected}
            # merge crops that converged to the same place
            selected = self._distinct(selected, corrected, 1 if pass_index else SECOND_PASS_CROPS)
            unfinished = any(self._needs_another_pass(crops[k], corrected[k]) for k in selected)
            if pass_index == MAX_PASSES - 1 or not unfinished:
                break
            crops, sources = [corrected[k] for k in selected], [sources[k] for k in selected]
        k = selected[0]
        return self._proposal(sources[k], crops[k], log_p[k], float(craft[k]), size[k])

    def infer_again(
        self,
        image: Array,
        noise: float,
        first: LearnedProposal,
        reduced: Optional[Array] = None,
        black: float = 0.0,
    ) -> LearnedProposal:
        """Return the proposal averaged over four quarter turns of its crop.

        The network was trained on every roll and its errors differ between rolls, so that averaging reduces them.

        Parameters
        ----------
        image : (H, W) array
            The image.
        noise : float
            Standard deviation of the image noise.
        first : LearnedProposal
            Proposal of the first round.
        reduced : (h, w) array, optional
            Image reduced by area averaging.
        black : float
            Black level.
        """
        crop = self._correct_crop(first.crop, np.log(first.p), first.log_size)
        pass_index = network_inputs(image, noise, self.camera, [crop], reduced, black)[0]
        rolled = [np.rot90(pass_index, k, axes=(1, 2)) for k in range(ROLLS)]
        log_p, craft, size = self.network(np.ascontiguousarray(rolled))
        p = np.zeros_like(log_p[0])
        for k in range(ROLLS):
            back = np.exp(log_p[k])
            for _ in range(k):
                # a quarter turn maps (x, y) to (y, -x)
                back = np.stack([back[:, 1, ::-1], back[:, 0]], axis=1)
            p += back / ROLLS
        # bins in which every turn's probability underflowed
        log_p = np.log(np.maximum(p, np.finfo(np.float32).tiny))
        return self._proposal(first.source, crop, log_p, float(craft.mean()), float(size.mean()))

    def log_likelihood(self, learned: LearnedProposal, q: Array, t: Array) -> Array:
        """Return the network's log-likelihoods (N,) of poses relative to that of the most likely pose.

        Parameters
        ----------
        learned : LearnedProposal
            Proposal of the image.
        q : (N, 4) array
            Attitude quaternions, camera from target.
        t : (N, 3) array
            Target positions, camera frame [m].
        """
        crop_from_camera = learned.crop.swing().T
        q_crop = quat.multiply(quat.from_matrix(crop_from_camera), q)
        t_crop = (t + quat.matrix(q) @ self.centre_m) @ crop_from_camera.T / self.radius_m
        score = log_likelihoods(learned.table, self.points, self._focal(learned.crop), q_crop, t_crop)
        return score / LIKELIHOOD_DIVISOR - learned.log_likelihood[0]

    def log_likelihood_deficit(self, image: Array, noise: float, q: Array, t: Array) -> float:
        """Return the log-likelihood deficit of a pose relative to the most likely pose in a crop around it.

        Parameters
        ----------
        image : (H, W) array
            The image.
        noise : float
            Standard deviation of the image noise.
        q : (4,) array
            Attitude quaternion, camera from target.
        t : (3,) array
            Target position, camera frame [m], within the image.
        """
        centre = t + quat.matrix(q) @ self.centre_m
        range_m = float(np.linalg.norm(centre))
        half_angle = np.arcsin(min(self.radius_m / range_m, 0.9))
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        crop = ImageCrop(centre / range_m, float(2 * f * np.tan(half_angle)))
        log_p, craft, size = self.network(network_inputs(image, noise, self.camera, [crop]))
        region = Region(0.0, 0.0, float(image.shape[1]), float(image.shape[0]), "predicted")
        proposal = self._proposal(region, crop, log_p[0], float(craft[0]), float(size[0]))
        return -float(self.log_likelihood(proposal, q[None], t[None])[0])

    def _distinct(self, order: Sequence[int], crops: Dict[int, ImageCrop], most: int) -> List[int]:
        """Return the first ``most`` of the crops that do not overlap."""
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        distinct: List[int] = []
        for k in order:
            if len(distinct) < most and all(_are_distinct(crops[k], crops[j], f) for j in distinct):
                distinct.append(k)
        return distinct

    def _needs_another_pass(self, before: ImageCrop, after: ImageCrop) -> bool:
        """Return True if a correction is large enough for another pass."""
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        shift = f * float(np.linalg.norm(before.direction - after.direction)) / after.diameter_px
        return shift > CONVERGED or abs(np.log(after.diameter_px / before.diameter_px)) > 2 * CONVERGED

    def _focal(self, crop: ImageCrop) -> float:
        """Return the focal length of a crop's camera [half sides]."""
        return (self.camera.fx_px + self.camera.fy_px) * INPUT_FILL / crop.diameter_px

    def _correct_crop(self, crop: ImageCrop, log_p: Array, log_size: float) -> ImageCrop:
        """Return the crop centred on the target at its most likely pose."""
        focal, log_size = self._focal(crop), float(np.clip(log_size, -MAX_LOG_SIZE, MAX_LOG_SIZE))
        t = most_likely_position(log_p, self.points, focal, log_size)
        shift = np.clip(focal * t[:2] / t[2], -MAX_SHIFT, MAX_SHIFT)
        return crop.moved(0.5 * (self.camera.fx_px + self.camera.fy_px), shift, log_size)

    def _proposal(
        self, source: Region, crop: ImageCrop, log_p: Array, craft: float, log_size: float
    ) -> LearnedProposal:
        modes = pose_modes(log_p, self.points, self._focal(crop), log_size, POSES_PER_CROP)
        score = modes.log_likelihood / LIKELIHOOD_DIVISOR
        swing = crop.swing()
        q = quat.multiply(quat.from_matrix(swing), modes.q)
        t = self.radius_m * modes.t @ swing.T - quat.matrix(q) @ self.centre_m
        return LearnedProposal(source, crop, q, t, score, craft, with_outliers(log_p), log_size)


def _are_distinct(a: ImageCrop, b: ImageCrop, f_px: float) -> bool:
    """Return True if two crops differ by a quarter of the target's size or in scale."""
    size = min(a.diameter_px, b.diameter_px)
    ratio = max(a.diameter_px, b.diameter_px) / size
    return bool(ratio > 1.3 or f_px * np.linalg.norm(a.direction - b.direction) > 0.25 * size)
