"""Faults of the camera and the line to a board, from a scenario's section or a separate file.

Kind, time in the flight and severity of each fault; one seed for every random choice.

Times are flight times of the affected frame [s]. Random choices depend on the seed and the frame's number alone, so a
lockstep run meets the same faults again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.runtime.toml_file import parse_toml, read_toml
from flyaround.simulator.runtime.validation_errors import convert_document

if TYPE_CHECKING:
    from pathlib import Path

# Maximum number of faults, against typing errors.
MAX_FAULTS = 1000

Time = Annotated[float, msgspec.Meta(ge=0, le=1e6)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Milliseconds = Annotated[float, msgspec.Meta(ge=0, le=60_000)]
Direction = Literal["to_board", "to_host", "both"]


class _Fault(Section, frozen=True, kw_only=True, tag_field="kind", tag=None):
    """Base class of faults, with start and end of the effect in flight time [s]."""

    start_s: Time = 0.0
    end_s: Time = 1e6

    @property
    def name(self) -> str:
        """Kind of the fault, as in the ledger."""
        return str(self.__struct_config__.tag)

    def acts(self, t_s: float) -> bool:
        """Return True if the fault is active at a time of the flight."""
        return self.start_s <= t_s < self.end_s


class StuckPixels(_Fault, tag="stuck_pixels", frozen=True, kw_only=True):
    """A share of the pixels returns a constant each, regardless of light."""

    share: Share = 0.001


class DeadPixels(_Fault, tag="dead_pixels", frozen=True, kw_only=True):
    """A share of the pixels returns 0."""

    share: Share = 0.001


class RowLoss(_Fault, tag="row_loss", frozen=True, kw_only=True):
    """Some rows of each frame, chosen anew, are 0."""

    rows: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 1
    chance: Share = 1.0


class ColumnLoss(_Fault, tag="column_loss", frozen=True, kw_only=True):
    """Some columns, the same in each frame, are 0."""

    columns: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 1


class HalfFrame(_Fault, tag="half_frame", frozen=True, kw_only=True):
    """The read-out stops early: rows below the share ``at`` of the height are 0."""

    chance: Share = 1.0
    at: Share = 0.5


class FrozenPicture(_Fault, tag="frozen", frozen=True, kw_only=True):
    """The camera repeats the last image before ``start_s``, with new numbers and times."""


class Blinding(_Fault, tag="blinding", frozen=True, kw_only=True):
    """A bright source: full scale within ``radius`` of a point, with a falloff outside; in image widths."""

    x: Share = 0.5
    y: Share = 0.5
    radius: Share = 0.2


class GainStep(_Fault, tag="gain_step", frozen=True, kw_only=True):
    """The digital numbers are multiplied by a factor."""

    factor: Annotated[float, msgspec.Meta(gt=0, le=1000)] = 2.0


class StuckExposure(_Fault, tag="exposure_stuck", frozen=True, kw_only=True):
    """The exposure time stays at its value at ``start_s``."""


class RepeatedNumber(_Fault, tag="repeated_number", frozen=True, kw_only=True):
    """The camera's own counter, in the time code, repeats the last number."""

    chance: Share = 1.0


CameraFault = (
    StuckPixels
    | DeadPixels
    | RowLoss
    | ColumnLoss
    | HalfFrame
    | FrozenPicture
    | Blinding
    | GainStep
    | StuckExposure
    | RepeatedNumber
)


class Delay(_Fault, tag="delay", frozen=True, kw_only=True):
    """Every packet is delayed."""

    delay_ms: Milliseconds
    direction: Direction = "to_board"


class Jitter(_Fault, tag="jitter", frozen=True, kw_only=True):
    """Every frame is delayed by a random time, uniform from 0; order is kept."""

    most_ms: Milliseconds
    direction: Direction = "to_board"


class Drop(_Fault, tag="drop", frozen=True, kw_only=True):
    """Packets of frames and answers are lost."""

    chance: Share
    direction: Direction = "both"


class Duplicate(_Fault, tag="duplicate", frozen=True, kw_only=True):
    """Packets of frames and answers are duplicated."""

    chance: Share
    direction: Direction = "both"


class Reorder(_Fault, tag="reorder", frozen=True, kw_only=True):
    """A packet arrives after the next one."""

    chance: Share
    direction: Direction = "both"


class Corrupt(_Fault, tag="corrupt", frozen=True, kw_only=True):
    """One bit of a packet is flipped."""

    chance: Share
    direction: Direction = "both"


class Bandwidth(_Fault, tag="bandwidth", frozen=True, kw_only=True):
    """The line is limited to a number of bytes a second."""

    bytes_per_s: Annotated[float, msgspec.Meta(ge=100, le=1e10)]
    direction: Direction = "to_board"


class Disconnect(_Fault, tag="disconnect", frozen=True, kw_only=True):
    """The line is cut once, at the first frame from ``start_s`` on."""


class ClockDrift(_Fault, tag="clock_drift", frozen=True, kw_only=True):
    """The board's clock runs fast by some parts per million."""

    ppm: Annotated[float, msgspec.Meta(ge=-100_000, le=100_000)]


LineFault = Delay | Jitter | Drop | Duplicate | Reorder | Corrupt | Bandwidth | Disconnect | ClockDrift


class Faults(Section, frozen=True, kw_only=True):
    """Injected faults of the camera and of the line to a board (hil host, campaigns).

    Parameters
    ----------
    seed : int, optional
        Seed of every random choice.
    camera : tuple of CameraFault, optional
        Simultaneous faults.
    line : tuple of LineFault, optional
        Simultaneous faults.
    schema : str, optional
        Name of the format.
    version : int, optional
        Version of the format.
    """

    seed: Annotated[int, msgspec.Meta(ge=0, le=2**62)] = 0
    camera: Annotated[tuple[CameraFault, ...], msgspec.Meta(max_length=MAX_FAULTS)] = ()
    line: Annotated[tuple[LineFault, ...], msgspec.Meta(max_length=MAX_FAULTS)] = ()
    schema: Literal["flyaround.faults"] = "flyaround.faults"
    version: Literal[1] = 1


NO_FAULTS = Faults()


def read_faults(path: Path) -> Faults:
    """Read faults from a TOML file.

    Returns
    -------
    Faults
        Checked faults; every one ends after it starts.

    Raises
    ------
    UserError
        If it is missing, or has a mistake: key, value and allowed values.
    """
    source = str(path)
    document = parse_toml(read_toml(path, source, "name a faults file"), source)
    faults = convert_document(document, Faults, source)
    check_times(faults, source)
    return faults


def check_times(faults: Faults, source: str) -> None:
    """Raise if a fault ends before it starts.

    Raises
    ------
    UserError
        If one does; the message states its times.
    """
    for fault in (*faults.camera, *faults.line):
        if not math.isfinite(fault.start_s + fault.end_s) or fault.end_s <= fault.start_s:
            raise UserError(
                f"{source}: a fault {fault.name!r} ends at {fault.end_s:g} s and starts at {fault.start_s:g} s; "
                "write an end_s above its start_s"
            )
