"""One stage of the estimator as a picture as large as fits."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.jobs.estimator_process import stage_text
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.jobs.estimator_process import Answer
    from flyaround.simulator.runtime.arrays import ByteArray

LIST_SHARE = 0.4
"""Largest share of the view's width for the list of stages."""


class StageView(Panel):
    """The stage that was clicked in *Estimator*, beside the camera's view; the list chooses another one."""

    name, title, place, shown = "stage", "Stage", "centre", False

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        w, imgui, estimates = self._w, self._imgui, console.jobs.estimates
        pictures = {} if estimates.newest is None else stage_pictures(estimates.newest.answer)
        titles = {name: stage_text(name)[0] for name in pictures}
        if titles:
            # a list at the left: rows of buttons would take the height that the picture needs
            wide = min(max(map(w.button_width, titles.values())), LIST_SHARE * w.width)
            with w.ctx.begin_child("stages", w.vec(wide, 0)):
                for name, title in titles.items():
                    on = name == estimates.stage
                    with w.coloured(style.ACCENT if on else style.INK):
                        if imgui.selectable(f"{w.elided(title, w.width)}###{name}", on)[0]:
                            console.do("estimator.stage", name)
                    w.tip(f"{title}: {stage_text(name)[1]}")
            imgui.same_line()
        place = self._free(32.0)
        if (picture := pictures.get(estimates.stage)) is None:
            Canvas(self._window).centred(place, "no picture of this stage in the newest estimate")
            return
        box = Letterbox.fit((picture.shape[1], picture.shape[0]), place)
        imgui.set_cursor_screen_pos(w.vec(box.x, box.y))
        imgui.image(w.window.show_picture(self.name, picture, picture), w.vec(box.width, box.height))
        w.tip(stage_text(estimates.stage)[1])


@lru_cache(maxsize=2)
def stage_pictures(answer: Answer) -> dict[str, ByteArray]:
    """Return the pictures of an answer's stages by name, without unreadable ones."""
    images = {name: cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) for name, data in answer.stages.items()}
    return {name: np.asarray(image, np.uint8) for name, image in images.items() if image is not None}
