"""Causes in a picture for which an estimator declines it, each with its remedy: target not in view, exposure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui.picture.screen import BURNT, BURNT_SHARE, DARK, SQUARE_PX, block_signals
from flyaround.gui.picture.truth_overlay import NEAR_M
from flyaround.gui.picture.view_settings import exposure_text
from flyaround.gui.texts import texts
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.piloting.docking_port import radius_m

if TYPE_CHECKING:
    from flyaround.gui.picture.feed import Picture
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.targets.model import Target

ALONG_EDGE = np.linspace(0.0, 1.0, 9)[:, None]
"""Positions along an edge at which it is looked for in the picture."""
IN_VIEW = 0.5
"""Share of the target's edges in the picture below which the view is the cause."""
LIT = 0.95
"""The target is dark if this quantile of the signals about it is below the threshold of a dark picture."""
CAUSES = texts("causes")
BY_METER = "Expose by the meter"
IN_SCENARIO = "change exposure_s in Scenario text, which a board's pictures follow"


def exposure_note(picture: Picture | None) -> str:
    """Return that the target is dark or burnt out in a picture, as the end of a sentence; empty if it is neither."""
    cause = decline_cause(picture.frame, picture.target) if picture else ""
    return f"; {cause}" if "exposure" in cause else ""


def decline_cause(frame: Frame, target: Target, remedy: str = BY_METER) -> str:
    """Return why a pose can hardly be estimated in a picture, and what to do.

    Parameters
    ----------
    frame : Frame
        The picture with its scene.
    target : Target
        Model of the target.
    remedy : str, optional
        How the exposure is changed.

    Returns
    -------
    str
        Kind of the cause, a colon and its remedy; empty if view and exposure are right.
    """
    scene = frame.scene
    ends = np.array([(e.a_m, e.b_m) for e in target.wireframe], float).reshape(-1, 2, 3)
    points = (ends[:, :1] + ALONG_EDGE * (ends[:, 1:] - ends[:, :1])).reshape(-1, 3)
    in_camera = scene.camera_from_target.apply(np.vstack([points, target.mass.com_m]))
    with np.errstate(all="ignore"):
        pixels = scene.camera.project(in_camera)
    in_view = (in_camera[:, 2] > NEAR_M) & scene.camera.contains(pixels)
    share = float(in_view.mean())
    if not share:
        x, y, z = in_camera[-1]
        # the boresight passes through the bounding sphere
        cause = "fills" if z > 0 and math.hypot(x, y) < radius_m(target) else "outside"
        return CAUSES[cause].format(distance=math.hypot(x, y, z))
    if share < IN_VIEW:
        return CAUSES["cut"].format(share=share)
    at = pixels[in_view] // SQUARE_PX
    (left, top), (right, low) = (np.clip(f(at, axis=0), 0, None).astype(int) for f in (np.min, np.max))
    light = block_signals(frame)[top : low + 1, left : right + 1]
    level = DARK + noise_sigma(scene.sensor)
    dark = float(np.mean(light <= level))
    # the space beside the craft is dark at any exposure
    burnt = float(np.mean(light[light > level] >= BURNT)) if dark < 1.0 else 0.0
    if burnt <= BURNT_SHARE and dark < LIT:
        return ""
    cause = "burnt" if burnt > BURNT_SHARE else "dark" if scene.sun_visible_fraction else "eclipse"
    figures = {"burnt": burnt, "dark": dark, "level": level, "exposure": exposure_text(scene.exposure_s)}
    return CAUSES[cause].format(**figures, remedy=remedy)
