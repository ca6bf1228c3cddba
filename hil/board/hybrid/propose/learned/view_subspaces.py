"""The drawn craft as matched subspaces: how well each attitude explains a small picture with faces of any brightness.

Seen from one direction the craft is a sum of its faces' shapes, each with a brightness nobody knows. These shapes span
a subspace of all small pictures; the share of a picture that lies in it says how well the attitude fits, whatever the
light. It costs a few products of matrices for hundreds of attitudes.

References
----------
Scharf & Friedlander (1994), Matched subspace detectors, IEEE Trans. Signal Processing 42(8).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import List, Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.native_faces import NativeFaces
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.model.view_tables import look_at, sphere_directions
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.propose.learned.attitude_basis import harmonics, quartered, turning_bumps
from flyaround.hil.board.hybrid.propose.learned.convolution import whole_numbers
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_FILL
from flyaround.hil.board.hybrid.propose.learned.network_input import ImageCrop, crop_image

Array = np.ndarray

# Directions, turns of the picture, and faces' shapes at most for each direction.
VIEWS, TURNS, SHAPES = 360, 32, 8

# Quarter turns of a look, and harmonics of what a turn makes of a bump.
QUARTERS, HARMONICS = 4, harmonics()

# Side of the small pictures [px], share of it that the craft's sphere fills, range they are drawn for [radii].
SIDE_PX, FILLED, RANGE_RADII = 24, 0.85, 9.0

# Wider structures than this belong to the background [px]; blur for what lies between two directions [px].
WIDE_PX, SOFT_PX = 4.0, 0.9

# Places and sizes tried about the given one: shifts in pixels each way, and factors.
SHIFTS_PX, SIZES = 1, (0.93, 1.0, 1.07)

# Share of the picture's pixels that count as independent.
INDEPENDENT = 0.7

# Weight of the explained share against the network's log-likelihood: of -log(1 - share).
WEIGHT = 6.0

# Attitudes compared, the likeliest by the network: what is handed on was the same of 300 (119 development frames).
COMPARED = 400

# The attitudes about a chosen one that are averaged with it [rad], and the difference of likelihood at which one of
# them counts e times less [log].
ABOUT_RAD, SOFTNESS = float(np.radians(13.0)), 1.5


@dataclass(frozen=True, eq=False)
class ViewSubspaces:
    """Views of the craft from all sides.

    Parameters
    ----------
    basis : (V, SHAPES, N) float32 orthonormal, times the window; zero where there are fewer. size : (V,) how many
        there are. q : (V * TURNS, 4) attitudes against the line of sight, turns of one direction together.
    bumps : (3, V, ANCHORS) of ``attitudes.turning_bumps``. window : (SIDE, SIDE).
    """

    basis: Array
    size: Array
    q: Array
    bumps: Array
    window: Array

    @staticmethod
    def of(model: BoardModel, faces: Faces) -> ViewSubspaces:
        """Draw the craft from every direction; takes a second or two."""
        faces = NativeFaces.of(faces)
        n, radius = SIDE_PX, model.radius_m
        window = _window()
        distance = RANGE_RADII * radius
        f = 0.5 * FILLED * n * float(np.sqrt(distance**2 - radius**2)) / radius
        camera = CameraIntrinsics(n, n, f, f, 0.5 * (n - 1), 0.5 * (n - 1))
        patch = ImagePatch(np.zeros((n, n), np.float32), 1.0, 0.0, 0.0, 1.0, 3)
        basis = np.zeros((VIEWS, SHAPES, n * n), np.float32)
        size = np.zeros(VIEWS, int)
        directions = sphere_directions(VIEWS)
        R = np.stack([look_at(d) for d in directions])
        of_group = np.concatenate([[0], faces.group + 1])
        for v in range(VIEWS):
            C = model.centre_m + distance * directions[v]
            group = of_group[draw_faces(faces, order_faces(faces, C), camera, R[v], -R[v] @ C, patch)]
            count = np.bincount(group.ravel(), minlength=2)[1:]
            shapes = [np.ones((n, n), np.float32)]
            for g in np.argsort(-count)[:SHAPES]:
                if count[g] == 0:
                    break
                share = cv2.resize((group == g + 1).astype(np.float32), (n, n), interpolation=cv2.INTER_AREA)
                shapes.append(_narrow(cv2.GaussianBlur(share, (0, 0), SOFT_PX)))
            Q, upper = np.linalg.qr(np.stack([(s * window).ravel() for s in shapes], axis=1).astype(float))
            # what earlier shapes have left of a shape must be more than rounding
            new = np.abs(np.diag(upper))[1:] > 0.05
            size[v] = int(new.sum())
            basis[v, : size[v]] = Q[:, 1:][:, new].T * window.ravel()
        turn = 2 * np.pi * np.arange(TURNS) / TURNS
        about = np.stack([np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)], axis=-1)
        straight = quat.from_matrix(R)
        q = quat.multiply(about[None], straight[:, None]).reshape(-1, 4)
        return ViewSubspaces(basis, size, q, turning_bumps(straight), window)

    @cached_property
    def packed(self) -> Tuple[Array, Array]:
        """The basis as the library takes it: whole numbers in rows as long as the moved picture's, and their worth."""
        views, shapes, _ = self.basis.shape
        rows = np.zeros((views, shapes, SIDE_PX, SIDE_PX + 2 * SHIFTS_PX), np.float32)
        rows[..., :SIDE_PX] = self.basis.reshape(views, shapes, SIDE_PX, SIDE_PX)
        whole, worth = whole_numbers(rows.reshape(views, shapes, -1))
        return whole, worth.astype(np.float32)

    def rank(
        self,
        image: Array,
        camera: CameraIntrinsics,
        crop: ImageCrop,
        coefficients: Array,
        keep: int,
        apart_rad: float,
        reduced: Optional[Array] = None,
        compared: int = COMPARED,
    ) -> Tuple[Array, Array, Array]:
        """Attitudes q (K, 4), corrections (K, 3) of shift [half sides of a look] and log size, score (K,), best first.

        Parameters
        ----------
        coefficients : (R, 4, ANCHORS) of the network, for inputs turned by none, one, two, and three quarters, R times;
            or (V * TURNS,), what ``likelihoods`` made of them. apart_rad : attitudes nearer to a better one are
            dropped. reduced : see ``network_input.crop_image``. compared : attitudes, the likeliest by the network.

        Notes
        -----
        The attitudes compared are some 10 deg apart. What is handed on is the mean of those about a chosen one,
        each by its likelihood: 4 instead of 6 deg off in the median.
        """
        likely = self.likelihood(coefficients) if coefficients.ndim > 1 else coefficients
        chosen = np.argpartition(-likely, compared)[:compared]
        share, move = self._explained(image, camera, crop, chosen, reduced)
        likely = likely[chosen] - WEIGHT * np.log(1 - share)
        q = self.q[chosen]
        # to a rotation both of its quaternions are the same
        near = np.abs(q @ q.T) >= np.cos(0.5 * apart_rad)
        best: List[int] = []
        left = np.ones(len(q), bool)
        for i in np.argsort(-likely):
            if left[i]:
                best.append(int(i))
                left &= ~near[i]
            if len(best) >= keep:
                break
        cosine = q[best] @ q.T
        about = np.abs(cosine) > np.cos(0.5 * ABOUT_RAD)
        weight = about * np.exp(np.clip((likely - likely[best][:, None]) / SOFTNESS, -30.0, 3.0))
        # a rotation and its negative quaternion are the same
        mean = quat.normalise((weight * np.sign(cosine)) @ q)
        return mean, (weight @ move) / weight.sum(axis=1)[:, None], likely[best]

    def likelihood(self, coefficients: Array) -> Array:
        """(V * TURNS,) logarithm of each attitude's likelihood, the mean over inputs turned by quarters.

        Parameters
        ----------
        coefficients : (R, 4, ANCHORS).
        """
        return self.likelihoods(coefficients.mean(axis=0)[None])[0]

    def likelihoods(self, coefficients: Array) -> Array:
        """(N, V * TURNS) the same of many places; coefficients (N, 4, ANCHORS)."""
        return np.stack([self._likelihood(said) for said in quartered(coefficients)])

    def _likelihood(self, said: Array) -> Array:
        """(V * TURNS,) log-likelihoods of coefficients (4, ANCHORS) of ``attitude_basis.quartered``."""
        _, views, n = self.bumps.shape
        if n % 8:
            raise ValueError(f"the library takes rows of a multiple of 8, not {n}")
        out, circle = np.empty(views * TURNS, np.float32), contiguous(_circle(), "float32")
        said = contiguous(said, "float32", (QUARTERS, n))
        bumps, waves = contiguous(self.bumps, "float32"), contiguous(HARMONICS, "float32")
        if library().fly_attitude_likelihood(bumps, said, waves, circle, views, TURNS, n, out):
            raise MemoryError("no memory for the likelihood of attitudes")
        return out

    def _explained(
        self,
        image: Array,
        camera: CameraIntrinsics,
        crop: ImageCrop,
        chosen: Array,
        reduced: Optional[Array],
    ) -> Tuple[Array, Array]:
        """Share (C,) that each chosen attitude explains at its best place and size, and that place and size (C, 3)."""
        side = 2 * SIDE_PX + 8
        picture = crop_image(image, camera, crop, side, FILLED * 2 * SIDE_PX, reduced)
        picture = cv2.blur(picture, (2, 2), anchor=(0, 0))
        view, turn = chosen // TURNS, chosen % TURNS
        taken = self.size / (INDEPENDENT * float(self.window.sum()))
        share, at = self._explained_shares(picture, view, turn, taken)
        moves = _moves()[at]
        # back from the turned small picture to half sides of a look
        angle = 2 * np.pi * turn / TURNS
        c, s = np.cos(angle), np.sin(angle)
        unit = 2 * INPUT_FILL / (FILLED * SIDE_PX) * np.exp(moves[:, 2])
        x, y = unit * (c * moves[:, 0] - s * moves[:, 1]), unit * (s * moves[:, 0] + c * moves[:, 1])
        return share, np.stack([x, y, moves[:, 2]], axis=-1)

    def _explained_shares(
        self, picture: Array, view: Array, turn: Array, taken: Array
    ) -> Tuple[Array, Array]:
        """Share (C,) that attitudes explain at their best move, and its number (C,).

        Parameters
        ----------
        picture : (n, n). view, turn : (C,) of each attitude. taken : (V,) share that noise gives to as many shapes.
        """
        side, count, m = len(picture), len(view), SIDE_PX + 2 * SHIFTS_PX
        if side < 2 or not _within(view, len(self.size)) or not _within(turn, TURNS):
            raise ValueError("views and turns must be of those that there are")
        # those of one turn together
        order = np.argsort(turn, kind="stable")
        share, move = np.empty(count), np.empty(count, np.int64)
        whole, worth = self.packed
        library().fly_subspace_match(
            contiguous(picture, "float32", (side, side)),
            side,
            contiguous(view[order], "int64", (count,)),
            contiguous(turn[order], "int64", (count,)),
            count,
            contiguous(_circle(), "float64"),
            np.array(SIZES),
            contiguous(np.stack([_wide().T, _wide()]), "float32", (2, m, m)),
            contiguous(whole, "int16", (len(self.size), SHAPES, SIDE_PX * m)),
            worth,
            contiguous(self.window * self.window, "float32", (SIDE_PX, SIDE_PX)),
            contiguous(taken, "float64", (len(self.size),)),
            share,
            move,
        )
        back = np.empty(count, np.intp)
        back[order] = np.arange(count)
        return share[back], move[back]


def _within(numbers: Array, count: int) -> bool:
    return not len(numbers) or (int(numbers.min()) >= 0 and int(numbers.max()) < count)


def _narrow(picture: Array) -> Array:
    return np.asarray(picture - cv2.GaussianBlur(picture, (0, 0), WIDE_PX))


@lru_cache(maxsize=1)
def _wide() -> Array:
    """(n, n) float32 the same blur of a line of the moved pictures: columns are what each pixel becomes."""
    n = SIDE_PX + 2 * SHIFTS_PX
    taps = round(8 * WIDE_PX + 1) | 1
    return np.asarray(cv2.GaussianBlur(np.eye(n, dtype=np.float32), (taps, 1), WIDE_PX))


@lru_cache(maxsize=1)
def _circle() -> Array:
    """(TURNS, 2) cosine and sine of each turn."""
    angle = 2 * np.pi * np.arange(TURNS) / TURNS
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _window() -> Array:
    """(SIDE, SIDE) one within the circle about the craft."""
    y, x = np.mgrid[:SIDE_PX, :SIDE_PX] - 0.5 * (SIDE_PX - 1)
    return np.clip(0.25 * (0.5 * SIDE_PX + 1 - np.hypot(x, y)) + 0.25, 0, 1).astype(np.float32)


def _moves() -> Array:
    """(moves, 3) shift of the craft in the turned picture [px of it] and logarithm of its size."""
    k = np.arange(-SHIFTS_PX, SHIFTS_PX + 1)
    return np.array([[x, y, np.log(s)] for s in SIZES for y in k for x in k])
