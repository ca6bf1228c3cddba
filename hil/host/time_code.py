"""Frame number and exposure time in the pixels, so that anyone can hold the ledger against the pictures alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.corner_code import CodePlace, CornerCode, draw_code
from hil.host.faults.definitions import NO_FAULTS, Faults, RepeatedNumber
from simulator.errors import UserError
from simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from simulator.frame import Frame


def with_time_code(
    frames: Iterable[Frame], place: CodePlace | None = None, faults: Faults = NO_FAULTS
) -> Iterator[Frame]:
    """Frames with a `hil.corner_code` in a corner: the camera's frame number and mid-exposure.

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
    counter = -1
    for frame in frames:
        height, width = frame.image.shape[:2]
        if not place.fits(height, width):
            left, top, right, bottom = place.box_px
            raise UserError(
                f"a time code takes {right - left} x {bottom - top} px and the picture has {width} x {height}: "
                "leave --time-code out, or read more of the sensor"
            )
        hit = list(frame.faults)
        repeats = False
        for k, fault in enumerate(faults.camera):
            if isinstance(fault, RepeatedNumber) and fault.acts(frame.scene.t_s) and counter >= 0:
                rng = np.random.default_rng((faults.seed, k, frame.number))
                if rng.random() < fault.chance:
                    repeats = True
                    hit.append(fault.name)
        counter = counter if repeats else frame.number
        code = CornerCode(counter, nanoseconds_utc(frame.scene.epoch_utc))
        image = draw_code(frame.image, code, place, 2**frame.scene.sensor.bits - 1)
        yield replace(frame, image=image, time_code_px=place.box_px, faults=tuple(hit))
