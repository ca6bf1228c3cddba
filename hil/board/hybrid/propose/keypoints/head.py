"""Keypoint head of one target, in NumPy: from the trunk's features to keypoint distributions; its file format.

The file is an ``.npz`` archive of half-precision arrays with JSON metadata, and is treated as untrusted input.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict, dataclass
from typing import Dict, Optional, Tuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.files import unpack_arrays
from flyaround.hil.board.hybrid.propose.keypoints.calibration import Calibration
from flyaround.hil.board.hybrid.propose.keypoints.network_output import BINS, KEYPOINTS
from flyaround.hil.board.json_values import BAD_VALUE

Array = np.ndarray

SCHEMA, VERSION = "flyaround.keypoint_head", 1

# Channels and side of the trunk's features; feature maps per keypoint, and hidden units.
FEATURES, CELLS, MAPS, HIDDEN = 192, 8, 4, 128

# Shape of each array of the head: convolution to feature maps, hidden layer and bins.
SHAPES: Dict[str, Tuple[int, ...]] = {
    "maps": (KEYPOINTS * MAPS, FEATURES, 3, 3),
    "maps_bias": (KEYPOINTS * MAPS,),
    "hidden": (HIDDEN, MAPS * CELLS * CELLS),
    "hidden_bias": (HIDDEN,),
    "bins": (2 * BINS, HIDDEN),
    "bins_bias": (2 * BINS,),
    "whole": (2, FEATURES),
    "whole_bias": (2,),
    "keypoints_m": (KEYPOINTS, 3),
}

# Largest unpacked size [bytes].
MAX_BYTES = 4_000_000


@dataclass(frozen=True, eq=False)
class KeypointHead:
    """Weights of a target's keypoint head.

    Parameters
    ----------
    craft : str
        Name of the target that it was trained for.
    trunk_sha256 : str
        Hash of the trunk that it was trained with.
    keypoints_m : (KEYPOINTS, 3) array
        Keypoints that it locates, target frame [m].
    weights : dict of str to array
        Arrays listed in ``SHAPES``, float32.
    calibration : Calibration, optional
        Calibration of the estimator with this head; None if there is none.
    """

    craft: str
    trunk_sha256: str
    keypoints_m: Array
    weights: Dict[str, Array]
    calibration: Optional[Calibration] = None

    def __call__(self, features: Array) -> Tuple[Array, Array, Array]:
        """Return keypoint log-probabilities (B, K, 2, BINS), presence logits (B,) and log sizes (B,).

        The log size is the logarithm of the bounding sphere's diameter over the diameter that the crop assumes.

        Parameters
        ----------
        features : (B, FEATURES, CELLS, CELLS) array
            Features of the trunk, float32.
        """
        w, n = self.weights, len(features)
        padded = np.pad(features, ((0, 0), (0, 0), (1, 1), (1, 1)))
        windows = sliding_window_view(padded, (3, 3), axis=(2, 3)).transpose(0, 2, 3, 1, 4, 5)
        columns = windows.reshape(n * CELLS * CELLS, -1)
        maps = np.maximum(columns @ w["maps"].reshape(len(w["maps"]), -1).T + w["maps_bias"], 0.0)
        of_keypoint = maps.reshape(n, CELLS * CELLS, KEYPOINTS, MAPS).transpose(0, 2, 3, 1)
        hidden = np.maximum(of_keypoint.reshape(n, KEYPOINTS, -1) @ w["hidden"].T + w["hidden_bias"], 0.0)
        logits = (hidden @ w["bins"].T + w["bins_bias"]).reshape(n, KEYPOINTS, 2, BINS)
        logits -= logits.max(axis=-1, keepdims=True)
        logits -= np.log(np.exp(logits).sum(axis=-1, keepdims=True))
        whole = (features.mean(axis=(2, 3)) @ w["whole"].T + w["whole_bias"]).astype(float)
        return logits, whole[:, 0], whole[:, 1]

    @staticmethod
    def read(data: bytes, name: str) -> KeypointHead:
        """Read a head from the bytes of its file.

        Parameters
        ----------
        data : bytes
            Contents of the file.
        name : str
            Name of the file, for messages.

        Returns
        -------
        KeypointHead
            Head with float32 weights, and keypoints in the target frame [m].

        Raises
        ------
        BoardModelError
            If the data are not a head of this version, or hold values that are not finite.
        """
        try:
            arrays = unpack_arrays(data, MAX_BYTES)
            sheet = json.loads(bytes(arrays["sheet"]).decode("utf-8"))
            weights = {key: np.asarray(arrays[key], np.float32) for key in SHAPES}
            if sheet.get("schema") != SCHEMA or sheet.get("version") != VERSION:
                raise ValueError(f"its metadata is not {SCHEMA} version {VERSION}")
            for key, shape in SHAPES.items():
                if weights[key].shape != shape:
                    raise ValueError(f"{key} has shape {weights[key].shape}, expected {shape}")
                if not np.isfinite(weights[key]).all():
                    raise ValueError(f"{key} holds values that are not finite")
            return KeypointHead(
                str(sheet["craft"]),
                str(sheet["trunk_sha256"]),
                np.asarray(weights.pop("keypoints_m"), float),
                weights,
                Calibration.from_dict(sheet["calibration"]) if "calibration" in sheet else None,
            )
        except BAD_VALUE as error:
            reason = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
            raise BoardModelError(
                f"keypoint network {name} cannot be used: {reason}; name a file that flyaround train wrote"
            ) from error

    def to_bytes(self) -> bytes:
        """Serialise the head as the bytes of a file.

        Returns
        -------
        bytes
            Content of an ``.npz`` file: weights in half precision, keypoints in single precision, and metadata as JSON.
        """
        sheet: Dict[str, object] = {
            "schema": SCHEMA,
            "version": VERSION,
            "craft": self.craft,
            "trunk_sha256": self.trunk_sha256,
        }
        if self.calibration is not None:
            sheet["calibration"] = asdict(self.calibration)
        arrays = {key: self.weights[key].astype(np.float16) for key in SHAPES if key in self.weights}
        data = io.BytesIO()
        text = np.frombuffer(json.dumps(sheet).encode(), np.uint8)
        np.savez(data, sheet=text, keypoints_m=self.keypoints_m.astype(np.float32), **arrays)  # type: ignore[arg-type]
        return data.getvalue()
