"""Ten images in which differences from a photograph are easiest to see: python -m tools.docs.ten_pictures FOLDER.

Render them before and after a change of the renderer. They show radiance at the preset ``high`` with one tone curve and
no noise. Five of them are scenes of the gallery, whose images docs/validation/ten_pictures.md shows.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import flyaround as fa
from flyaround.simulator.scenario.poses import scene_with_pose
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_normalize
from tools.docs.gallery import (
    Picture,
    above,
    earthrise,
    eclipse_entry,
    exposed,
    film,
    glare,
    glint,
    limb,
    moonrise,
    radiance,
    write_jpeg,
)

PLACE = (20.0, -30.0, 420.0)  # latitude [deg], longitude [deg] and altitude [km]


def craft_before(
    renderer: fa.Renderer,
    name: str,
    turn: tuple[float, float, float],
    distance_m: float,
    **sky: Any,  # noqa: ANN401 - arguments of `above`
) -> np.ndarray:
    """Return a craft in the afternoon Sun in front of the sky or ground given by ``sky``."""
    target = fa.load_target(name)
    scene = above("2026-06-20T15:30:00Z", PLACE, 40.0, **sky)
    scene = replace(scene, target=TargetRef(name=target.name, sha256=target.sha256))
    q = quat_normalize(quat_from_rotvec(np.array(turn)))
    scene = scene_with_pose(
        scene, target, Pose.from_arrays("camera", "target", q, np.array([0.0, 0.0, distance_m])), 0
    )
    return exposed(glare(radiance(renderer, scene, name)), 0.99)


def twilight(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of the limb through a long lens, with the Sun 2 degrees below the horizon there."""
    scene = above("2026-03-20T21:35:00Z", (45.0, -20.0, 420.0), 12.0, azimuth_deg=290.0, off_nadir_deg=70.3)
    return exposed(radiance(renderer, scene), 0.985)


def foil(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of multi-layer insulation at 3 m."""
    return craft_before(renderer, "tango-mli", (1.5, 0.5, 0.3), 2.2, azimuth_deg=100.0, off_nadir_deg=60.0)


def clouds(renderer: fa.Renderer) -> np.ndarray:
    """Return a craft at 3 m in front of clouds."""
    return craft_before(renderer, "tango", (2.2, -0.5, 0.4), 3.0, azimuth_deg=200.0, off_nadir_deg=35.0)


def geostationary(renderer: fa.Renderer) -> np.ndarray:
    """Return the whole Earth from the geostationary orbit."""
    scene = above("2026-06-20T13:30:00Z", (0.0, 0.0, 35_786.0), 30.0)
    return exposed(radiance(renderer, scene), 0.98)


def night_silhouette(renderer: fa.Renderer) -> np.ndarray:
    """Return a craft in the Earth's shadow in front of city lights."""
    target = fa.load_target("tango")
    scene = above("2026-11-09T22:30:00Z", (44.0, 8.0, 420.0), 50.0, azimuth_deg=60.0, off_nadir_deg=40.0)
    q = quat_normalize(quat_from_rotvec(np.array([2.3, 0.5, 0.4])))
    scene = scene_with_pose(
        scene, target, Pose.from_arrays("camera", "target", q, np.array([0.3, 0.0, 5.0])), 0
    )
    return film(glare(radiance(renderer, scene)), 0.0011)


TEN: tuple[tuple[str, Picture], ...] = (
    ("limb", limb),
    ("twilight", twilight),
    ("glint", glint),
    ("moon", moonrise),
    ("lunar-orbit", earthrise),
    ("foil", foil),
    ("night-city", night_silhouette),
    ("clouds", clouds),
    ("geostationary", geostationary),
    ("eclipse", eclipse_entry),
)


def main(folder: str, *names: str) -> None:
    """Render all images, or the named ones."""
    output = Path(folder)
    output.mkdir(parents=True, exist_ok=True)
    with fa.Renderer() as renderer:
        for name, picture in TEN:
            if not names or name in names:
                write_jpeg(output / f"{name}.jpg", picture(renderer))


if __name__ == "__main__":
    main(*sys.argv[1:])
