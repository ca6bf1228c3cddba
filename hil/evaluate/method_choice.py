"""Choice of estimators, and the model that they use."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.board.estimation import BoardModel
from flyaround.hil.board.method_names import HYBRID_TRACK, NETWORK
from flyaround.hil.board_model.write import board_record

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import Target


class MethodChoice(msgspec.Struct, frozen=True):
    """Method with its solver and streams; None stands for the method's defaults."""

    method: str
    solver: str | None = None
    streams: tuple[str, ...] | None = None

    @property
    def in_order(self) -> bool:
        """True if the frames must be evaluated in order, in one process."""
        return self.method == HYBRID_TRACK

    @property
    def label(self) -> str:
        """Label in tables and file names."""
        extra = [*([self.solver] if self.solver else []), *(self.streams or ())]
        # only the file name of a network, because the label is part of file names
        method = self.method
        if method.startswith(NETWORK):
            method = NETWORK + Path(method.removeprefix(NETWORK)).name
        return " ".join([method, *extra])


def board_model(target: Target) -> BoardModel:
    """Return the board model of a target.

    Returns
    -------
    BoardModel
        Model in the form that a board reads, with the faces and network that `board_record` gives it.
    """
    return BoardModel.from_dict(msgspec.to_builtins(board_record(target)))
