"""Background libraries: images without a craft, and the table of camera positions and attitudes."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from typing import TYPE_CHECKING

from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.loop import FrameRequest, open_frames, whole_frame
from flyaround.simulator.recipes.backgrounds import draw_view, without_target
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.simulator.recipes.plan import RecipePlan

COLUMNS = ("id", "rx_deg", "ry_deg", "rz_deg", "epoch_utc", "r_x_m", "r_y_m", "r_z_m", "redraws")


def write_library(
    plan: RecipePlan,
    folder: Path,
    n: int | None = None,
    *,
    device_index: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> int:
    """Render the first views of a recipe's background library into ``images/NNNNNN.png``.

    The table ``views.csv`` lists for each view the camera's Euler angles in the order of
    `flyaround.simulator.recipes.euler_poses`, its geocentric position (GCRS), and the number of rejected draws.

    Parameters
    ----------
    plan : RecipePlan
        Recipe with its camera and sensor.
    folder : Path
        Existing folder to write to.
    n : int, optional
        Number of views; by default the whole library.
    device_index : int, optional
        EGL device to render on; None for the driver's choice.
    progress : callable, optional
        Called with the number of finished views and of all.

    Returns
    -------
    int
        Number of views.

    Raises
    ------
    UserError
        If the recipe has no library, or it has fewer views.
    """
    library = plan.library(n)
    count = library.views
    (folder / "images").mkdir(parents=True)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    with open_frames(
        whole_frame, device_index=device_index, first=plan.scene(0), target=plan.target
    ) as producer:
        scenes = (without_target(plan.scene_before(library, i)) for i in range(count))
        requests = (
            FrameRequest(scene=replace(scene, frame_index=i), labels=False) for i, scene in enumerate(scenes)
        )
        for i, frame in enumerate(producer.frames(requests)):
            write_atomic(folder / "images" / f"{i:06d}.png", encode_png(frame.image))
            view = draw_view(library, plan.camera, i)
            place = view.place
            table.writerow([i, *view.euler_deg, place.now.iso(), *place.camera_eci_m, view.redraws])
            progress(i + 1, count)
    write_atomic(folder / "views.csv", text.getvalue().encode())
    return count
