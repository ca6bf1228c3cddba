"""Files of trained pose networks: ``.npz`` archives of float32 weights with JSON metadata.

The metadata names the target and camera and holds the errors on held-out images. Files are untrusted input: size,
shapes and values are checked.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Dict, Tuple, Union

import numpy as np

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.files import read_bounded, unpack_arrays
from flyaround.hil.board.json_values import BAD_VALUE
from flyaround.hil.board.net.network_camera import NetworkCamera
from flyaround.hil.board.net.residual_network import ARCHITECTURES

Array = np.ndarray

SCHEMA, VERSION = "flyaround.network", 2

# Largest file [bytes]; then the range of an input image's sides and of the number of attitude classes.
MAX_BYTES = 256_000_000

# Allowed side of the input [px], and number of attitude classes.
SIDE_PX, CLASSES = (16, 1024), (8, 20_000)


@dataclass(frozen=True)
class HeldOutErrors:
    """RMS errors on held-out images.

    Parameters
    ----------
    turn_rad : float
        Rotation error about each axis.
    across_share : float
        Position error across the line of sight, as a share of the range.
    along_share : float
        Position error along the line of sight, as a share of the range.
    """

    turn_rad: float
    across_share: float
    along_share: float


@dataclass(frozen=True, eq=False)
class NetworkFile:
    """A trained pose network with its metadata.

    Parameters
    ----------
    name : str
        Name of the file.
    target : str
        Name of the target that it was trained on.
    sha256 : str
        Hash of that target.
    camera : NetworkCamera
        Camera of the input images.
    classes : int
        Number of attitude classes.
    log_range_mean : float
        Mean of the natural logarithm of the range [m] in training.
    log_range_scale : float
        Its scale; the third output of the place is standardised by both.
    errors : HeldOutErrors
        Errors of accepted estimates on held-out images.
    architecture : str
        One of ``ARCHITECTURES``.
    weights : dict of str to array
        Weights by name, see `Architecture.run`.
    """

    name: str
    target: str
    sha256: str
    camera: NetworkCamera
    classes: int
    log_range_mean: float
    log_range_scale: float
    errors: HeldOutErrors
    architecture: str
    weights: Dict[str, Array]

    @staticmethod
    def read(path: Union[str, Path]) -> NetworkFile:
        """Read and check a file that ``flyaround train`` wrote.

        Returns
        -------
        NetworkFile
            Network, whose name is that of the file.

        Raises
        ------
        BoardModelError
            If the file cannot be read or is not a valid network; the message is one sentence.
        """
        try:
            data = read_bounded(path, MAX_BYTES)
        except OSError as error:
            raise BoardModelError(
                f"network {path} cannot be read: {error.strerror or error}; name a file that flyaround train wrote"
            ) from error
        except ValueError as error:
            raise BoardModelError(f"network {path!r} cannot be read: {error}") from error
        try:
            return _parse(Path(path).name, unpack_arrays(data, MAX_BYTES))
        except BAD_VALUE as error:
            reason = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
            raise BoardModelError(
                f"network {path} cannot be used: {reason}; name a file that flyaround train wrote"
            ) from error

    def to_bytes(self, training: Dict[str, Any]) -> bytes:
        """Serialise the network as the bytes of a file.

        Parameters
        ----------
        training : dict of str to object
            Description of the training, stored as information only.

        Returns
        -------
        bytes
            Content of an ``.npz`` file.
        """
        sheet = {
            "schema": SCHEMA,
            "version": VERSION,
            "target": self.target,
            "target_sha256": self.sha256,
            **asdict(self.camera),
            "classes": self.classes,
            "log_range_mean": self.log_range_mean,
            "log_range_scale": self.log_range_scale,
            "architecture": self.architecture,
            "held_out": asdict(self.errors),
            "training": training,
        }
        data = io.BytesIO()
        np.savez(data, sheet=np.frombuffer(json.dumps(sheet).encode(), np.uint8), **self.weights)  # type: ignore[arg-type]
        return data.getvalue()

    def run(self, picture: Array) -> Tuple[Array, Array]:
        """Run the network on one standardised float32 image (h, w).

        Returns
        -------
        place : (3,) array
            Place in the image and range, as of `Architecture.run`.
        logits : (K,) array
            Logits of the attitude classes.
        """
        return ARCHITECTURES[self.architecture].run(self.weights, picture)


def _parse(name: str, arrays: Dict[str, Array]) -> NetworkFile:
    sheet = json.loads(arrays.pop("sheet").tobytes().decode("utf-8"))
    if not isinstance(sheet, dict) or sheet.get("schema") != SCHEMA or sheet.get("version") != VERSION:
        raise ValueError(f"its metadata is not {SCHEMA} version {VERSION}")
    camera = NetworkCamera(
        _read_integer(sheet, "width_px", *SIDE_PX),
        _read_integer(sheet, "height_px", *SIDE_PX),
        _real(sheet, "f_px", 1.0, 1e5),
    )
    classes, architecture = _read_integer(sheet, "classes", *CLASSES), _text(sheet, "architecture")
    if architecture not in ARCHITECTURES:
        raise ValueError(f"its architecture is {architecture!r}, allowed: {', '.join(ARCHITECTURES)}")
    for key, (shape, _) in (
        ARCHITECTURES[architecture].layers(camera.width_px, camera.height_px, classes).items()
    ):
        _check_weights(arrays, key, shape)
        _check_weights(arrays, f"{key}_bias", shape[:1])
    errors = sheet["held_out"]
    return NetworkFile(
        name=name,
        target=_text(sheet, "target"),
        sha256=_text(sheet, "target_sha256"),
        camera=camera,
        classes=classes,
        log_range_mean=_real(sheet, "log_range_mean", -20.0, 20.0),
        log_range_scale=_real(sheet, "log_range_scale", 1e-3, 20.0),
        errors=HeldOutErrors(
            _real(errors, "turn_rad", 1e-6, 10.0),
            _real(errors, "across_share", 1e-6, 100.0),
            _real(errors, "along_share", 1e-6, 100.0),
        ),
        architecture=architecture,
        weights=arrays,
    )


def _check_weights(arrays: Dict[str, Array], key: str, shape: Tuple[int, ...]) -> None:
    array = arrays[key]
    if array.dtype != np.float32 or array.shape != shape:
        raise ValueError(f"its {key} is {array.dtype} of shape {array.shape}, expected float32 of {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"its {key} holds values that are not finite")


def _read_integer(sheet: Dict[str, Any], key: str, low: int, high: int) -> int:
    value = sheet[key]
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"its {key} is {str(value)[:40]}, allowed: {low} to {high}")
    return value


def _real(sheet: Dict[str, Any], key: str, low: float, high: float) -> float:
    value = sheet[key]
    if type(value) not in (int, float) or not low <= value <= high:
        raise ValueError(f"its {key} is {str(value)[:40]}, allowed: {low:g} to {high:g}")
    return float(value)


def _text(sheet: Dict[str, Any], key: str) -> str:
    value = sheet[key]
    if not isinstance(value, str) or len(value) > 200:
        raise ValueError(f"its {key} is not a short text")
    return value
