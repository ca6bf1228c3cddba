"""The board file: keypoints, wireframe and occluders of a target as one small JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from simulator.files import write_atomic
from simulator.targets.convert import board_model

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.targets.model import Target


def write_board_model(target: Target, path: Path) -> None:
    """Write what a board needs of ``target`` (docs/formats/target.md).

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_atomic(path, msgspec.json.format(msgspec.json.encode(board_model(target)), indent=1))
