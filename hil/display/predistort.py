"""Pre-distortion of frames for a screen, so that the camera sees them as rendered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.display.calibration import DisplayCalibration
    from flyaround.simulator.runtime.arrays import ByteArray


# Steps of the table from brightness to screen levels: finer than 12 bits of a camera.
LIGHT_STEPS = 4096


class Predistorter:
    """Mapping of frames to a screen by a calibration; its tables are computed once.

    Parameters
    ----------
    calibration : DisplayCalibration
        Calibration of the screen and the camera that views it.
    """

    def __init__(self, calibration: DisplayCalibration) -> None:
        width, height = calibration.screen_px
        columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        points = np.column_stack((columns.ravel(), rows.ravel()))
        camera = calibration.camera_from_screen(points).astype(np.float32)
        self._camera_x = camera[:, 0].reshape(height, width)
        self._camera_y = camera[:, 1].reshape(height, width)
        light = np.maximum(calibration.screen_light_dn(points), calibration.white_dn)
        self._gain = (calibration.white_dn / light).reshape(height, width).astype(np.float32)
        self._levels = calibration.levels_for(np.linspace(0.0, 1.0, LIGHT_STEPS + 1)).astype(np.float32)
        self.calibration = calibration

    def screen_image(self, image: NDArray[Any], white: float) -> ByteArray:
        """Return the screen levels (H, W) that show a frame.

        Parameters
        ----------
        image : (H, W) array
            Frame of the camera's size, linear in brightness.
        white : float
            Pixel value that is shown as white.

        Returns
        -------
        (H, W) array
            Screen levels, uint8.

        Raises
        ------
        UserError
            If the frame does not have the calibrated camera's size.
        """
        width, height = self.calibration.camera_px
        if image.shape != (height, width):
            raise UserError(
                f"the frame is {image.shape[1]} x {image.shape[0]} px but the calibrated camera {width} x {height}: "
                "use that camera in the scenario (docs/hil_display.md)"
            )
        light = np.asarray(image, np.float32) / np.float32(white)
        on_screen = cv2.remap(
            light,
            self._camera_x,
            self._camera_y,
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=0.0,
        )
        relative_light = np.clip(on_screen * self._gain, 0.0, 1.0)
        levels = self._levels[np.rint(relative_light * (len(self._levels) - 1)).astype(np.intp)]
        return np.rint(levels).astype(np.uint8)
