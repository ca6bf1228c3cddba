"""Keypoint network: one trunk for all targets, evaluated by OpenCV, and a head for each target."""

from __future__ import annotations

import hashlib
import pkgutil
from dataclasses import dataclass
from functools import lru_cache
from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.propose.keypoints.head import KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.network_output import keypoints_m
from flyaround.hil.board.hybrid.propose.keypoints.single_precision import in_single_precision

Array = np.ndarray

PACKAGE = "flyaround.hil.board.hybrid.propose.keypoints"

# Targets with the same shape but other surfaces share a head.
SHARED_HEADS = {"tango-mockup": "tango"}

# Largest displacement of a keypoint since the training [radii of the bounding sphere].
MAX_DISPLACEMENT_RADII = 0.03


@dataclass(frozen=True, eq=False)
class KeypointNetwork:
    """Trunk, and the head of one target.

    Parameters
    ----------
    trunk : cv2.dnn.Net
        Computes the features of an input.
    head : KeypointHead
        Computes the keypoint distributions from the features.
    """

    trunk: cv2.dnn.Net
    head: KeypointHead

    def __call__(self, inputs: Array) -> Tuple[Array, Array, Array]:
        """Return log-probabilities, presence logits and log sizes, see `KeypointHead`.

        Parameters
        ----------
        inputs : (B, 2, S, S) array
            Float32, see ``network_input.channels``.
        """
        self.trunk.setInput(inputs)
        return self.head(self.trunk.forward())


@lru_cache(maxsize=1)
def trunk_bytes() -> bytes:
    """Return the shipped trunk.

    Returns
    -------
    bytes
        Content of an ONNX file.

    Raises
    ------
    BoardModelError
        If the package lacks the file.
    """
    # a bundle is a zip file, so its members are read through the importer
    data = pkgutil.get_data(PACKAGE, "weights/trunk.onnx")
    if data is None:
        raise BoardModelError("the keypoint network's trunk is missing; reinstall flyaround")
    return data


@lru_cache(maxsize=1)
def _trunk() -> cv2.dnn.Net:
    return cv2.dnn.readNetFromONNX(np.frombuffer(in_single_precision(trunk_bytes()), np.uint8))


def trunk_sha256() -> str:
    """Return the hash of the shipped trunk.

    Returns
    -------
    str
        SHA-256 of `trunk_bytes`, as hexadecimal digits.
    """
    return hashlib.sha256(trunk_bytes()).hexdigest()


def network_for(model: BoardModel) -> Optional[KeypointNetwork]:
    """Return the keypoint network of a target.

    Returns
    -------
    KeypointNetwork or None
        Network with the head in the model, or else the shipped one. None if there is neither, or if a keypoint has
        moved since the training of the shipped head.

    Raises
    ------
    BoardModelError
        If the head in the model is invalid, or was trained for another shape or with another trunk.
    """
    if model.network is not None:
        head = KeypointHead.read(model.network, f"of {model.name}")
        if not _matches(head, model):
            raise BoardModelError(
                f"the keypoint network of {model.name} was trained for another shape ({head.craft}); train it again"
            )
    else:
        data = _shipped_head(SHARED_HEADS.get(model.name, model.name))
        if data is None:
            return None
        head = KeypointHead.read(data, model.name)
        if not _matches(head, model):
            return None
    if head.trunk_sha256 != trunk_sha256():
        raise BoardModelError(
            f"the keypoint network of {model.name} was trained on another version's trunk; train it again"
        )
    return KeypointNetwork(_trunk(), head)


def _shipped_head(name: str) -> Optional[bytes]:
    if not name.replace("-", "").replace("_", "").isalnum():
        return None
    try:
        return pkgutil.get_data(PACKAGE, f"weights/{name}.npz")
    except OSError:
        return None


def has_shipped_head(name: str) -> bool:
    """Return True if a head is shipped for the target called ``name``.

    Returns
    -------
    bool
        True if there is a file, also if it does not fit the present shape of the target.
    """
    return _shipped_head(SHARED_HEADS.get(name, name)) is not None


def _matches(head: KeypointHead, model: BoardModel) -> bool:
    displacement = np.linalg.norm(head.keypoints_m - keypoints_m(model), axis=1).max()
    return bool(displacement < MAX_DISPLACEMENT_RADII * model.radius_m)
