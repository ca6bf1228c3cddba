"""Sink that shows frames on a screen, pre-distorted for the camera, with a code to identify them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.hil.corner_code import CodePlace, CornerCode, draw_code
from flyaround.simulator.errors import UserError
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from flyaround.hil.display.predistort import Predistorter
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray


class Screen(Protocol):
    """Display of images: a monitor, or a recorder in tests."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height [px]."""

    def show(self, image: ByteArray) -> None:
        """Show screen levels (H, W)."""


@dataclass(frozen=True)
class DisplayRecord:
    """Record of a shown frame: number, mid-exposure and display time, since 1970-01-01 UTC [ns]."""

    frame_id: int
    time_ns: int
    shown_ns: int


class ScreenSink:
    """Sink that shows each frame on a screen.

    Parameters
    ----------
    screen : Screen
        Window on the screen.
    predistorter : Predistorter or None
        Pre-distortion by a calibration; None shows frames unchanged, in the middle of the screen.
    code : bool
        Draw the code of frame number and time.
    hold_s : float
        Minimum time for which each frame is shown [s].
    """

    def __init__(
        self, screen: Screen, predistorter: Predistorter | None, *, code: bool = True, hold_s: float = 0.0
    ) -> None:
        self._screen, self._predistorter, self._code, self._hold_s = screen, predistorter, code, hold_s
        self.shown: list[DisplayRecord] = []

    @property
    def code_place(self) -> CodePlace:
        """Position of the code in the frame."""
        return CodePlace() if self._predistorter is None else self._predistorter.calibration.code_place

    def write(self, frame: Frame) -> None:
        """Show one frame.

        Raises
        ------
        UserError
            If the frame is in colour, or does not fit the screen or the calibration.
        """
        if frame.image.ndim != 2:
            raise UserError('a screen shows one channel: write bands = "mono" under [output] of the scenario')
        white = 2**frame.scene.sensor.bits - 1
        time_ns = nanoseconds_utc(frame.scene.epoch_utc)
        image = frame.image
        if self._code:
            image = draw_code(image, CornerCode(frame.scene.frame_index, time_ns), self.code_place, white)
        if self._predistorter is None:
            levels = self._centred(np.rint(image * (255 / white)).astype(np.uint8))
        else:
            levels = self._predistorter.screen_image(image, white)
        self._screen.show(levels)
        self.shown.append(DisplayRecord(frame.scene.frame_index, time_ns, time.time_ns()))
        time.sleep(self._hold_s)

    def _centred(self, image: ByteArray) -> ByteArray:
        width, height = self._screen.size_px
        if image.shape[0] > height or image.shape[1] > width:
            raise UserError(
                f"the frame is {image.shape[1]} x {image.shape[0]} px but the screen {width} x {height}: "
                "calibrate (hil display --patterns), or give the scenario a smaller camera"
            )
        top, left = (height - image.shape[0]) // 2, (width - image.shape[1]) // 2
        screen = np.zeros((height, width), np.uint8)
        screen[top : top + image.shape[0], left : left + image.shape[1]] = image
        return screen
