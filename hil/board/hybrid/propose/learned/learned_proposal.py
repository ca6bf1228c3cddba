"""The learned proposal: poses of a region of interest by a network that corrects its crop and scores attitudes.

A first pass corrects each crop's centre and size, a second rates it; four quarter turns of the best are averaged into a
likelihood on SO(3). The likeliest attitudes are ranked again by how well the target's faces explain the crop.

References
----------
Sharma & D'Amico (2019), Pose estimation for non-cooperative rendezvous using neural networks (classes of attitude,
then geometry); Murphy et al. (2021), Implicit-PDF (several maxima on SO(3)).
"""

from __future__ import annotations

import io
import pkgutil
from dataclasses import dataclass, field
from functools import lru_cache
from typing import List, Optional, Sequence, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.propose.learned.network import ProposalNetwork
from flyaround.hil.board.hybrid.propose.learned.network_input import ImageCrop, network_inputs
from flyaround.hil.board.hybrid.propose.learned.view_subspaces import QUARTERS, ViewSubspaces
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray

# Crafts that have another's shape, in another paint: its network is theirs.
KIN = {"tango-mockup": "tango"}

# Folders of the weights trained in sunlight, and in that of lamps.
WEIGHTS, LAMPS = "weights", "weights/lamps"

# Diameter of the target's bounding sphere over the diagonal of a region; two of them for sources that often hold a
# part.
SPHERE_OVER_BOX, SPHERE_OVER_PART, PARTS = (1.15,), (1.3, 2.4), ("saliency", "straight")

# Attitudes proposed for one crop, and how much less likely than the first the last may be [log].
ATTITUDES, LESS = 16, 9.0

# The same for each of many given crops, and attitudes compared there.
HELD_ATTITUDES, HELD_COMPARED = 8, 150

# What a crop that the network wants narrower counts against one that it wants wider.
TOO_WIDE = 0.5

# Non-maximum suppression of attitudes [rad].
APART_RAD = float(np.radians(11.0))

# How near to a pose the attitudes are that tell its likelihood [rad]: about the step from one to the next.
NEAR_RAD = float(np.radians(10.0))

# A crop this much less sure of a target than the surest is left out [logit], unless it is sure by itself and the surest
# may be a part of it: an instrument on a white plate inputs like a far craft in front of a bright Earth.
DOUBT, CERTAIN = 4.0, 8.0

# By how much a whole is wider than its part.
WIDER = 1.5

# Crops that get a second pass.
SECOND = 5

# How often a proposed crop is averaged over quarter turns, each time at the crop corrected before.
ROUNDS = 2

# How far the sphere and centre of a model may be from those of the training [radii].
SAME_M = 0.03

# Largest corrections of one proposal [half sides, log].
SHIFT, SIZE = 0.7, 0.7


@dataclass(frozen=True, eq=False)
class LearnedProposal:
    """Poses that the network proposes for one crop.

    Parameters
    ----------
    crop : the corrected direction and size. q (K, 4), t (K, 3), log_likely (K,) : poses, the likeliest first.
    craft : logit of there being a craft. source : the proposal it started from.
    likely : (V * TURNS,) logarithm of each attitude's likelihood against the line of sight, see ``ViewSubspaces.q``.
    """

    source: Region
    crop: ImageCrop
    q: Array
    t: Array
    log_likely: Array
    craft: float
    likely: Array

    def region(self, camera: CameraIntrinsics) -> Region:
        """Square about the target's bounding sphere; may reach beyond the image."""
        u, v = camera.pixels(self.crop.direction)
        r = 0.5 * self.crop.diameter_px
        return Region(float(u - r), float(v - r), float(u + r), float(v + r), "learned")


@lru_cache(maxsize=4)
def shipped_network(name: str, folder: str = WEIGHTS) -> Optional[ProposalNetwork]:
    """The network shipped for a target of this name, `None` if there is none.

    Parameters
    ----------
    folder : of the light that it was trained in, ``WEIGHTS`` or ``LAMPS``.
    """
    if not name.replace("-", "").replace("_", "").isalnum():
        return None
    try:
        # a bundle is a zip file: its members are read through the importer
        data = pkgutil.get_data("flyaround.hil.board.hybrid.propose.learned", f"{folder}/{name}.npz")
        return None if data is None else ProposalNetwork.read(io.BytesIO(data))
    except (OSError, ValueError, KeyError):
        return None


def network_for(model: BoardModel, folder: str = WEIGHTS) -> Optional[ProposalNetwork]:
    """The network trained for this model, `None` if there is none or the model has changed since."""
    net = shipped_network(KIN.get(model.name, model.name), folder)
    if net is None:
        return None
    away = np.linalg.norm(net.centre_m - model.centre_m) + abs(net.radius_m - model.radius_m)
    return net if away < SAME_M * net.radius_m else None


@dataclass(frozen=True, eq=False)
class LearnedProposer:
    """A target's network and the views of its faces, prepared for images of one camera."""

    network: ProposalNetwork
    views: ViewSubspaces
    camera: CameraIntrinsics
    centre_m: Array
    radius_m: float

    @staticmethod
    def prepare(
        model: BoardModel, camera: CameraIntrinsics, folder: str = WEIGHTS
    ) -> Optional[LearnedProposer]:
        """`None` if there is no network for this model, or it has no faces."""
        net = network_for(model, folder)
        if net is None or model.faces is None:
            return None
        return LearnedProposer(
            net, _views(_ModelKey(model.sha256, model)), camera, model.centre_m, model.radius_m
        )

    def propose(
        self,
        image: Array,
        noise: float,
        regions: Sequence[Region],
        keep: int,
        reduced: Optional[Array] = None,
        black: float = 0.0,
    ) -> List[LearnedProposal]:
        """Proposals for the most likely crops of these regions, the surest of a target first.

        Parameters
        ----------
        image : (H, W). noise : its standard deviation. regions : of interest. keep : proposals at most. reduced :
            the image reduced by area averaging, if at hand. black : what the image adds to light.
        """
        if not regions:
            return []
        camera = self.camera
        f = 0.5 * (camera.fx_px + camera.fy_px)
        starts = [
            (r, size)
            for r in regions
            for size in (SPHERE_OVER_PART if r.source in PARTS else SPHERE_OVER_BOX)
        ]
        crops = [
            ImageCrop.at(camera, 0.5 * (r.x0 + r.x1), 0.5 * (r.y0 + r.y1), size * r.diagonal_px)
            for r, size in starts
        ]
        _, craft, crops = self._corrected_crops(image, noise, crops, reduced, black)
        # the first proposal corrects a start, the second says how sure it is of a craft there
        better = [int(k) for k in np.argsort(-craft)[:SECOND]]
        starts, crops = [starts[k] for k in better], [crops[k] for k in better]
        _, craft, crops = self._corrected_crops(image, noise, crops, reduced, black)
        chosen: List[int] = []
        for k in np.argsort(-craft):
            if len(chosen) < keep and all(_apart(crops[k], crops[j], f) for j in chosen):
                chosen.append(int(k))
        looked = [
            (starts[k][0], *self._averaged_over_turns(image, noise, crops[k], reduced, black)) for k in chosen
        ]
        looked.sort(key=lambda g: -g[2])
        worth = plausible_crops([sure for *_, sure, _ in looked], [crop for *_, crop in looked], f)
        out = []
        for source, coefficients, sure, crop in (looked[k] for k in worth):
            likely = self.views.likelihood(coefficients)
            q, move, score = self.views.rank(image, camera, crop, likely, ATTITUDES, APART_RAD, reduced)
            near = score > score[0] - LESS
            Q, t = self._placed(crop, q[near], move[near])
            out.append(LearnedProposal(source, crop, Q, t, score[near], sure, likely))
        return out

    def propose_at(
        self,
        image: Array,
        noise: float,
        source: Region,
        crops: Sequence[ImageCrop],
        keep: int,
        reduced: Optional[Array] = None,
        black: float = 0.0,
    ) -> List[LearnedProposal]:
        """Proposals for the ``keep`` crops that the network would correct least, as given; others as in ``propose``.

        Only those kept are averaged over quarter turns.
        """
        inputs = network_inputs(image, noise, self.camera, crops, reduced, black)
        said, rest = self.network(inputs)
        # what is lit is taken for the craft: a crop that seems too wide may be right
        size = np.maximum(rest[:, 2], -TOO_WIDE * rest[:, 2])
        kept = np.argsort(np.hypot(rest[:, 0], rest[:, 1]) + size)[:keep]
        others = [self.network(np.stack([np.rot90(inputs[g], k) for k in range(1, QUARTERS)])) for g in kept]
        sides = [np.concatenate([said[g][None], o]) for g, (o, _) in zip(kept, others)]  # noqa: B905 - the same
        likely = self.views.likelihoods(np.stack(sides))
        out = []
        for g, own, (_, more) in zip(kept, likely, others):  # noqa: B905 - Python 3.9 has no strict=
            q, move, score = self.views.rank(
                image, self.camera, crops[g], own, HELD_ATTITUDES, APART_RAD, reduced, HELD_COMPARED
            )
            near = score > score[0] - LESS
            Q, t = self._placed(crops[g], q[near], move[near])
            sure = float(np.append(more[:, 3], rest[g, 3]).mean())
            out.append(LearnedProposal(source, crops[g], Q, t, score[near], sure, own))
        return out

    def log_likelihood(self, learned: Sequence[LearnedProposal], q: Array, t: Array) -> float:
        """Log-likelihood of a pose's attitude by the network alone, over that of the likeliest attitude.

        Parameters
        ----------
        learned : of one picture, at least one; that which inputs nearest is asked, and at what is as wide. q (4,),
            t (3,) : the pose.
        """
        centre = t + quat.matrix(q) @ self.centre_m
        f, distance = 0.5 * (self.camera.fx_px + self.camera.fy_px), float(np.linalg.norm(centre))
        wide = 2 * f / np.sqrt(max((distance / self.radius_m) ** 2 - 1.0, 1e-6))

        def beside(g: LearnedProposal) -> float:
            off = f * np.linalg.norm(g.crop.direction - centre / distance) / wide
            return float(off + abs(np.log(g.crop.diameter_px / wide)))

        proposal = min(learned, key=beside)
        seen = quat.multiply(quat.from_matrix(proposal.crop.swing().T), q)
        cosine = np.abs(self.views.q @ seen)
        # the nearest one at least; a pose that is no number has none
        near = cosine >= min(np.cos(0.5 * NEAR_RAD), cosine.max())
        return float(np.max(proposal.likely[near], initial=-np.inf) - proposal.likely.max())

    def _turned(
        self, image: Array, noise: float, crop: ImageCrop, reduced: Optional[Array], black: float
    ) -> Array:
        """(4, 64, 64, 2) the network's input in four quarter turns."""
        one = network_inputs(image, noise, self.camera, [crop], reduced, black)[0]
        return np.stack([np.rot90(one, k) for k in range(QUARTERS)])

    def _averaged_over_turns(
        self, image: Array, noise: float, crop: ImageCrop, reduced: Optional[Array], black: float
    ) -> Tuple[Array, float, ImageCrop]:
        """Coefficients (ROUNDS, 4, J) of inputs in quarter turns, logit of a target, corrected crop.

        Test-time augmentation: the network was trained on every roll, so four turns of one input err differently.
        """
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        coefficients, sure = [], 0.0
        for _ in range(ROUNDS):
            said, rest = self.network(self._turned(image, noise, crop, reduced, black))
            x, y = rest[:, 0], rest[:, 1]
            # what is right in a look turned by a quarter is below in the first, and so on
            shift = np.array([x[0] - y[1] - x[2] + y[3], y[0] + x[1] - y[2] - x[3]]) / QUARTERS
            size = float(np.clip(rest[:, 2].mean(), -SIZE, SIZE))
            crop = crop.moved(f, np.clip(shift, -SHIFT, SHIFT), size)
            coefficients.append(said)
            sure = float(rest[:, 3].mean())
        return np.stack(coefficients), sure, crop

    def _corrected_crops(
        self, image: Array, noise: float, crops: List[ImageCrop], reduced: Optional[Array], black: float
    ) -> Tuple[Array, Array, List[ImageCrop]]:
        """Attitude coefficients (B, J), logits of a craft (B,), corrected crops."""
        coefficients, rest = self.network(network_inputs(image, noise, self.camera, crops, reduced, black))
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        moved = [
            g.moved(f, np.clip(r[:2], -SHIFT, SHIFT), float(np.clip(r[2], -SIZE, SIZE)))
            for g, r in zip(crops, rest)  # noqa: B905 - Python 3.9 has no strict=
        ]
        return coefficients, rest[:, 3], moved

    def _placed(self, crop: ImageCrop, q_sight: Array, move: Array) -> Tuple[Array, Array]:
        """Camera poses q (K, 4), t (K, 3) of attitudes against the line of sight, each with its correction."""
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        q, t = [], []
        for attitude, m in zip(q_sight, move):  # noqa: B905 - Python 3.9 has no strict=
            # in front of a texture the faces explain the more the less of it is compared: 7 % too far in the median
            g = crop.moved(f, m[:2], 0.0)
            distance = self.radius_m * float(np.hypot(1.0, 2 * f / g.diameter_px))
            R = g.swing() @ quat.matrix(attitude)
            q.append(quat.from_matrix(R))
            t.append(distance * g.direction - R @ self.centre_m)
        return np.array(q).reshape(-1, 4), np.array(t).reshape(-1, 3)


@dataclass(frozen=True)
class _ModelKey:
    """A model as a cache key: its hash."""

    sha256: str
    model: BoardModel = field(compare=False)


@lru_cache(maxsize=1)
def _views(drawn: _ModelKey) -> ViewSubspaces:
    """Views of a model, rendered once for all estimators."""
    faces = drawn.model.faces
    assert faces is not None  # noqa: S101 - the caller asked
    return ViewSubspaces.of(drawn.model, faces)


def plausible_crops(sure: Sequence[float], crops: Sequence[ImageCrop], f_px: float) -> List[int]:
    """Indices of the crops worth proposing.

    Parameters
    ----------
    sure : logit of a craft at each, the surest first. crops : at each. f_px : focal length.
    """
    return [
        k
        for k in range(len(sure))
        if sure[k] >= sure[0] - DOUBT or (sure[k] > CERTAIN and _holds(crops[k], crops[0], f_px))
    ]


def _holds(a: ImageCrop, b: ImageCrop, f_px: float) -> bool:
    """Whether a crop may be a part of what a wider one shows."""
    off = f_px * np.linalg.norm(a.direction - b.direction)
    return bool(a.diameter_px > WIDER * b.diameter_px and off < 0.5 * a.diameter_px)


def _apart(a: ImageCrop, b: ImageCrop, f_px: float) -> bool:
    """Whether two crops show different things: a quarter of the target's size apart, or of another size."""
    size = min(a.diameter_px, b.diameter_px)
    ratio = max(a.diameter_px, b.diameter_px) / size
    return bool(ratio > 1.3 or f_px * np.linalg.norm(a.direction - b.direction) > 0.25 * size)
