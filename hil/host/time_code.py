"""Frame number and exposure time in the pixels, so that anyone can hold the ledger against the pictures alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flyaround.hil.corner_code import CodePlace, CornerCode, draw_code
from flyaround.hil.host.faults.camera_faults import with_camera_numbers
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from flyaround.simulator.frame import Frame


def with_time_code(
    frames: Iterable[Frame], place: CodePlace | None = None, faults: Faults = NO_FAULTS
) -> Iterator[Frame]:
    """Frames with a `flyaround.hil.corner_code` in a corner: the camera's frame number and mid-exposure.

    Parameters
    ----------
    place : where; the upper left corner unless given. ``time_code_px`` of each frame says which pixels.
    faults : of these, `RepeatedNumber` keeps the camera's counter at the last number.

    Raises
    ------
    UserError
        If the code does not fit the picture.
    """
    place = CodePlace() if place is None else place
    for frame in with_camera_numbers(frames, faults):
        height, width = frame.image.shape[:2]
        if not place.fits(height, width):
            left, top, right, bottom = place.box_px
            raise UserError(
                f"a time code takes {right - left} x {bottom - top} px and the picture has {width} x {height}: "
                "leave --time-code out, or read more of the sensor"
            )
        counter = frame.number if frame.camera_frame is None else frame.camera_frame
        code = CornerCode(counter, nanoseconds_utc(frame.scene.epoch_utc))
        image = draw_code(frame.image, code, place, 2**frame.scene.sensor.bits - 1)
        yield replace(frame, image=image, time_code_px=place.box_px)
