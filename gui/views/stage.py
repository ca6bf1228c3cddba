"""One stage of the estimator as a picture as large as fits."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.gui.canvas import Canvas
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.jobs.estimator_process import Answer
    from flyaround.simulator.runtime.arrays import ByteArray


class StageView(Panel):
    """The stage that was clicked in *Estimator*, beside the camera's view; its buttons choose another one."""

    name, title, place, shown = "stage", "Stage", "centre", False

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        w, estimates = self._w, console.jobs.estimates
        pictures = {} if estimates.newest is None else stage_pictures(estimates.newest.answer)
        for k, name in enumerate(pictures):
            title = name.replace("_", " ")
            w.flow(w.button_width(title), first=k == 0)
            w.button(console, "estimator.stage", name, label=title, on=name == estimates.stage)
        place = self._free(32.0)
        if (picture := pictures.get(estimates.stage)) is None:
            Canvas(self._window).centred(place, "no picture of this stage in the newest estimate")
            return
        box = Letterbox.fit((picture.shape[1], picture.shape[0]), place)
        w.imgui.set_cursor_screen_pos(w.vec(box.x, box.y))
        w.imgui.image(w.window.show_picture(self.name, picture, picture), w.vec(box.width, box.height))
        w.tip(f"result of the stage {estimates.stage.replace('_', ' ')}")


@lru_cache(maxsize=2)
def stage_pictures(answer: Answer) -> dict[str, ByteArray]:
    """Return the pictures of an answer's stages by name, without unreadable ones."""
    images = {name: cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) for name, data in answer.stages.items()}
    return {name: np.asarray(image, np.uint8) for name, image in images.items() if image is not None}
