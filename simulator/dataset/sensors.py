"""Plug-in sensors: additional measurements of a frame, in a file next to its image."""

from __future__ import annotations

import io
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.plugins import plugins

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.simulator.frame import Frame


def parse_sensors(text: str) -> tuple[str, ...]:
    """Parse a comma-separated list of sensors, and import each.

    Returns
    -------
    tuple of str
        Distinct names in the order of the text; empty for an empty text.

    Raises
    ------
    UserError
        If a name is unknown, or its package cannot be imported.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    installed = plugins("sensor")
    for name in names:
        if name not in installed:
            available = ", ".join(installed) or "none: they come with packages, see docs/plugins.md"
            raise UserError(f"unknown sensor '{name}' in --sensors; installed are {available}")
        if not callable(installed[name].load()):
            raise installed[name].wrong("cannot be called")
    return names


def measurements(frame: Frame, names: Iterable[str]) -> dict[str, bytes]:
    """Return each sensor's measurements of a frame, as the bytes of an NPZ file.

    A sensor's random numbers depend only on the frame's seed and number, and on the sensor's name.

    Raises
    ------
    UserError
        If one fails, or returns anything but arrays by name.
    """
    return {f"{name}.npz": _measured(frame, name) for name in names}


def _measured(frame: Frame, name: str) -> bytes:
    plugin = plugins("sensor").get(name)
    if plugin is None:
        raise UserError(f"sensor {name} is not installed any more; install its package again")
    key = (frame.scene.frame_index, zlib.crc32(name.encode()))
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(frame.scene.seed, spawn_key=key)))
    try:
        returned: Any = plugin.load()(frame, rng)
        arrays = {str(k): np.asarray(v) for k, v in returned.items()}
    except UserError:
        raise
    except Exception as error:
        raise plugin.wrong(f"failed on frame {frame.number} ({type(error).__name__}: {error})") from error
    if any(a.dtype.hasobject for a in arrays.values()):
        raise plugin.wrong("gives objects, which no file holds: give arrays of numbers")
    data = io.BytesIO()
    np.savez_compressed(data, allow_pickle=False, **arrays)
    return data.getvalue()
