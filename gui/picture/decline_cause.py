"""Causes in a picture for which an estimator declines it, each with its remedy: target not in view, exposure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui.picture.screen import BURNT, BURNT_SHARE, DARK, SQUARE_PX, block_signals
from flyaround.gui.picture.truth_overlay import NEAR_M
from flyaround.gui.picture.view_settings import exposure_text
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.piloting.docking_port import radius_m

if TYPE_CHECKING:
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.targets.model import Target

ALONG_EDGE = np.linspace(0.0, 1.0, 9)[:, None]
"""Positions along an edge at which it is looked for in the picture."""
IN_VIEW = 0.5
"""Share of the target's edges in the picture below which the view is the cause."""
LIT = 0.95
"""The target is dark if this quantile of the signals about it is below the threshold of a dark picture."""
BY_METER = "Expose by the meter"
IN_SCENARIO = "change exposure_s in Scenario text, which a board's pictures follow"


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
        centre, distance = in_camera[-1], float(np.linalg.norm(in_camera[-1]))
        # the boresight passes through the bounding sphere
        if centre[2] > 0 and np.hypot(*centre[:2]) / distance < radius_m(target) / distance:
            return (
                f"the target fills the picture: fly back from {distance:.1f} m until its outline is in view"
            )
        return "the target is out of the picture: it has to be in view, Centre target turns the camera to it"
    if share < IN_VIEW:
        return f"the target is cut off: {share:.0%} of its edges are in the picture; centre it or fly back"
    light = block_signals(frame)
    low, high = (
        np.clip(f(pixels[in_view], axis=0) // SQUARE_PX, 0, None).astype(int) for f in (np.min, np.max)
    )
    light = light[low[1] : high[1] + 1, low[0] : high[0] + 1]
    exposure, level = exposure_text(scene.exposure_s), DARK + noise_sigma(scene.sensor)
    dark = float(np.mean(light <= level))
    # the space beside the craft is dark at any exposure
    burnt = float(np.mean(light[light > level] >= BURNT)) if dark < 1.0 else 0.0
    if burnt > BURNT_SHARE:
        return (
            f"the target is burnt out: {burnt:.0%} of the lit pixels about it have full scale at {exposure}; "
            f"lower the exposure: {remedy}"
        )
    if dark >= LIT:
        why = "" if scene.sun_visible_fraction else " in the shadow of the Earth"
        return (
            f"the target is dark{why}: {dark:.0%} of the pixels about it are below {level:.0%} of full scale "
            f"at {exposure}; raise the exposure: {remedy}"
        )
    return ""
