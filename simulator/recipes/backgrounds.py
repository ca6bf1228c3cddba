"""Background libraries: views of a body from random places in orbit, with random camera attitudes.

View i depends only on the library's seed and i. For training, a craft is rendered into the scene of a view, under its
illumination, rather than pasted over an image. ``flyaround backgrounds`` renders the images without a craft.

References
----------
Hematulin et al. (2025), Aerospace 12(4) 334, algorithm 2: three Euler angles, each uniform in +-360 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.euler_poses import from_left_handed, quat_from_euler
from flyaround.simulator.recipes.sky import PlaceInSky, random_moment
from flyaround.simulator.scenario.random_draws import numbered_generator, uniform_direction
from flyaround.simulator.scene.sample import BackgroundView
from flyaround.simulator.world.ephemeris.body import bodies_at, body_named
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.recipe import Background
    from flyaround.simulator.scene.state import SceneState

# Maximum number of draws until a sample meets all conditions.
MAX_DRAWS = 1000

_MIN_SUN_SHARE, _MIN_SUN_SINE = 0.999, 0.05
"""Smallest visible share of the Sun's disc at the craft, and smallest sine of its elevation on the ground."""

# Position of the target behind the camera, for pictures of the background alone [m].
_HIDDEN_POSITION_M = (0.0, 0.0, -1000.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class DrawnView:
    """One random view of a background library.

    Parameters
    ----------
    reference : BackgroundView
        Library and number of the view, as recorded in labels.
    place : PlaceInSky
        Place and attitude of the camera.
    euler_deg : array
        Euler angles of the camera, left-handed axes.
    redraws : int
        Number of draws that were rejected, for example because the ground was not lit.
    """

    reference: BackgroundView
    place: PlaceInSky
    euler_deg: FloatArray
    redraws: int


def draw_view(library: Background, camera: Camera, number: int) -> DrawnView:
    """Draw view ``number`` of a library.

    Parameters
    ----------
    library : Background
        Settings of the library.
    camera : Camera
        Camera whose image must show the body's day side.
    number : int
        Number of the view.

    Returns
    -------
    DrawnView
        Place and attitude of the camera.

    Raises
    ------
    UserError
        If a thousand draws give no acceptable view.
    """
    rng = numbered_generator(library.seed, number, 0xBAC6)
    body = body_named(library.body)
    for draw in range(MAX_DRAWS):
        now = random_moment(rng)
        up, angles = uniform_direction(rng), rng.uniform(-360.0, 360.0, 3)
        along = np.cross(up, uniform_direction(rng))
        R = matrix_from_quat(from_left_handed(quat_from_euler(angles)))
        r_sun, bodies = sun_eci_m(now.tt1, now.tt2), bodies_at(now, body)
        centre, v_centre = body.geocentric_state(now)
        r = (body.radius_m + library.altitude_km * 1e3) * up
        sunlit = sun_fraction_past_bodies(bodies, centre + r, r_sun) > _MIN_SUN_SHARE
        to_sun = (r_sun - centre) / np.linalg.norm(r_sun - centre)
        behind = R[:, 2] @ to_sun > -np.cos(np.radians(library.max_phase_deg))
        if not sunlit or behind or _sunlit_share(camera, R, body.radius_m, r, to_sun) < library.least_share:
            continue
        place = PlaceInSky(
            now=now,
            body=body,
            R_eci_from_camera=R,
            camera_eci_m=centre + r,
            centre_m_s=v_centre,
            along_eci=along,
            r_sun_eci_m=r_sun,
            bodies=bodies,
        )
        reference = BackgroundView(body=library.body, library_seed=library.seed, id=number)
        return DrawnView(reference=reference, place=place, euler_deg=angles, redraws=draw)
    raise UserError(
        f"section [background]: a thousand draws give no sunlit view with a phase below {library.max_phase_deg:g} deg "
        f"and the day side of {body.title} in {library.least_share:g} of the image: "
        "widen max_phase_deg, or lower least_share"
    )


def without_target(scene: SceneState) -> SceneState:
    """Move the craft of a scene out of view, for a library's image.

    Returns
    -------
    SceneState
        Copy with the target a kilometre behind the camera; its state on GCRS axes is unchanged.
    """
    return replace(scene, t_camera_from_target_m=_HIDDEN_POSITION_M)


def _sunlit_share(
    camera: Camera, R_eci_from_camera: FloatArray, radius_m: float, r_m: FloatArray, to_sun: FloatArray
) -> float:
    """Return the share of a grid of pixels that show the body's sunlit ground.

    Parameters
    ----------
    camera : Camera
        Camera of the image.
    R_eci_from_camera : (3, 3) array
        Rotation from camera axes to ECI.
    radius_m : float
        Radius of the body [m].
    r_m : (3,) array
        Camera position from the body's centre.
    to_sun : (3,) array
        Unit vector to the Sun.
    """
    u, v = np.meshgrid(np.linspace(0, camera.width_px - 1, 13), np.linspace(0, camera.height_px - 1, 10))
    rays = camera.rays(np.stack([u.ravel(), v.ravel()], axis=1)) @ R_eci_from_camera.T
    along = rays @ r_m
    inside = along**2 - r_m @ r_m + radius_m**2
    hits = (inside > 0) & (along < 0)
    ground = r_m + (-along - np.sqrt(np.maximum(inside, 0)))[:, None] * rays
    return float(np.mean(hits & (ground @ to_sun > _MIN_SUN_SINE * radius_m)))
