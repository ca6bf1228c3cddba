"""Make docs/gallery.md and its images by rendering: python -m tools.docs.gallery."""

import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import flyaround as fa
from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.poses import scene_with_pose
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import sunlight_balance
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import place_itrs_m, scene_above
from flyaround.simulator.world.ephemeris.earth_orientation import q_itrs_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import moon_eci_m, sun_eci_m
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_normalize,
)
from flyaround.simulator.world.time.instant import Instant

DOCS = Path(__file__).parents[2] / "docs"
SIZE = (1120, 700)  # size of an image [px]
JPEG = 82  # quality of the images
LARGEST_BYTES = 100_000  # maximum size of an image file
Picture = Callable[[fa.Renderer], np.ndarray]


def camera(field_deg: float, size: tuple[int, int] = SIZE) -> Camera:
    """Return a pinhole camera with a horizontal field of view."""
    f = size[0] / 2 / np.tan(np.radians(field_deg) / 2)
    return Camera(
        width_px=size[0],
        height_px=size[1],
        fx_px=f,
        fy_px=f,
        cx_px=size[0] / 2 - 0.5,
        cy_px=size[1] / 2 - 0.5,
    )


def above(
    epoch: str,
    place: tuple[float, float, float],
    field_deg: float,
    size: tuple[int, int] = SIZE,
    **more: Any,  # noqa: ANN401 - passed on
) -> fa.SceneState:
    """Return a scene without spacecraft."""
    ref = TargetRef(name="tango", sha256=fa.load_target("tango").sha256)
    return scene_above(epoch, place, camera=camera(field_deg, size), target=ref, quality="high", **more)


def radiance(renderer: fa.Renderer, scene: fa.SceneState, target: str = "tango") -> np.ndarray:
    """Return the linear RGB radiance of a scene, scaled so that a sunlit white surface is grey."""
    bands = renderer.render(scene, fa.load_target(target)).radiance * sunlight_balance("rgb")
    return np.asarray(np.maximum(bands @ np.transpose(SRGB_FROM_BANDS), 0.0))


def film(light: np.ndarray, brightest: float, contrast: float = 0.3) -> np.ndarray:
    """Return an sRGB image with the tone curve of photographic film: a shoulder, a toe, pale lights, a little grain.

    Parameters
    ----------
    light : (H, W, 3) array
        Linear radiance.
    brightest : float
        Radiance at the beginning of the shoulder.
    contrast : float, optional
        Contrast of the middle of the curve.
    """
    y = light * (0.8 / brightest)
    y = np.where(y < 0.5, y, 0.5 + 0.5 * (1 - np.exp(-(y - 0.5) / 0.6)))
    pale = 0.1 + 0.3 * np.clip(y.max(axis=2, keepdims=True), 0, 1) ** 2
    y = np.clip((1 - pale) * y + pale * y.mean(axis=2, keepdims=True), 0, 1)
    v = np.where(y < 0.0031308, 12.92 * y, 1.055 * y ** (1 / 2.4) - 0.055)
    v += contrast * (v * v * (3 - 2 * v) - v)
    # its own in every picture, and twice as strong in the lights as in the darks
    rng = np.random.default_rng(zlib.crc32(np.rint(255 * v).astype(np.uint8)))
    grain = rng.standard_normal(v.shape) * (0.8 + 0.8 * v)
    return np.asarray(np.clip(v * 255 + 0.5 + grain, 0, 255), np.uint8)


def exposed(light: np.ndarray, share: float, stops: float = 0.0) -> np.ndarray:
    """Return an image exposed so that ``share`` of its pixels lie below the shoulder, or brighter by ``stops``."""
    return film(light, float(np.quantile(light[light > 0], share)) * 2.0**-stops)


def glare(light: np.ndarray) -> np.ndarray:
    """Return the image of a good lens at full aperture: a core of 0.7 pixels and halos of 5 % of the light."""
    shares = {0.7: 0.95, 4.0: 0.03, 16.0: 0.014, 64.0: 0.006}
    return np.asarray(sum(w * cv2.GaussianBlur(light, (0, 0), s) for s, w in shares.items()))


def noon(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of Egypt."""
    scene = above("2026-03-20T09:30:00Z", (27.0, 34.0, 420.0), 60.0, azimuth_deg=340.0, off_nadir_deg=42.0)
    return exposed(radiance(renderer, scene), 0.98, -0.4)


def terminator(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of sunset over the North Atlantic."""
    scene = above("2026-03-20T19:41:00Z", (48.0, -35.0, 420.0), 55.0, azimuth_deg=265.0, off_nadir_deg=61.0)
    return exposed(radiance(renderer, scene), 0.995, 0.9)


def night(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of Italy and the Alps with the Moon high and full."""
    scene = above("2026-11-24T22:30:00Z", (42.0, 6.0, 420.0), 60.0, azimuth_deg=60.0, off_nadir_deg=56.0)
    return film(glare(radiance(renderer, scene)), 0.0011)


def glint(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of the Aegean."""
    scene = above("2026-06-20T15:10:00Z", (37.5, 29.0, 420.0), 55.0, azimuth_deg=275.0, off_nadir_deg=56.0)
    return exposed(glare(radiance(renderer, scene)), 0.97, -0.5)


def shallows(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of the Great Bahama Bank."""
    scene = above("2026-04-10T16:00:00Z", (22.3, -78.3, 420.0), 60.0, azimuth_deg=20.0, off_nadir_deg=30.0)
    return exposed(radiance(renderer, scene), 0.985)


def limb(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of the horizon through a long lens."""
    scene = above("2026-06-20T15:00:00Z", (10.0, -30.0, 420.0), 7.0, azimuth_deg=300.0, off_nadir_deg=69.4)
    return exposed(radiance(renderer, scene), 0.95, -0.4)


def eclipse_entry(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of Tango in front of the limb in the last half minute of sunlight."""
    epoch, latitude, height_km = "2026-03-20T12:00:00Z", 10.0, 420.0
    now = Instant.from_utc(epoch)
    sun = matrix_from_quat(q_itrs_from_eci(now)) @ sun_eci_m(now.tt1, now.tt2).reshape(3)
    # the Sun's ray passes 16 km above the ground; in the afternoon, because the view is to the west
    dip = -np.arccos((6371.0 + 16.0) / (6371.0 + height_km))
    longitudes = np.arange(60.0, 150.0, 0.02)
    heights = np.array(
        [
            np.arcsin(place_itrs_m(latitude, float(x), height_km)[1][2] @ sun / np.linalg.norm(sun))
            for x in longitudes
        ]
    )
    longitude = float(longitudes[np.argmin(np.abs(heights - dip))])
    target = fa.load_target("tango")
    scene = above(epoch, (latitude, longitude, height_km), 40.0, azimuth_deg=292.0, off_nadir_deg=73.0)
    turn = quat_normalize(quat_from_rotvec(np.array([2.3, 0.5, 0.4])))
    scene = scene_with_pose(
        scene, target, Pose.from_arrays("camera", "target", turn, np.array([-0.7, 0.25, 5.6])), 0
    )
    light = radiance(renderer, scene)
    white = float(np.quantile(light, 0.985))
    # the Sun's disc is 1e5 times as bright as the limb; the lens spreads at most the full well

    well = 2000 * white / np.maximum(light.max(axis=2, keepdims=True), 2000 * white)
    return film(glare(light * well), white)


def moonrise(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of the Moon over the sunlit limb."""
    epoch = "2026-03-30T16:00:00Z"
    now = Instant.from_utc(epoch)
    moon = matrix_from_quat(q_itrs_from_eci(now)) @ moon_eci_m(now.tt1, now.tt2).reshape(3)
    best, position = 9.0, (0.0, 0.0, 420.0)
    # at this longitude the Moon is just above the horizon, which lies 19.8 degrees below the horizontal
    for longitude in np.arange(-180.0, 180.0, 0.25):
        r, enu = place_itrs_m(15.0, float(longitude), 420.0)
        to_moon = (moon - r) / np.linalg.norm(moon - r)
        height = np.degrees(np.arcsin(enu[2] @ to_moon))
        rising = enu[0] @ to_moon > 0  # afternoon, before full Moon
        if rising and abs(height + 19.15) < best:
            best, position = abs(height + 19.15), (15.0, float(longitude), 420.0)
    return exposed(radiance(renderer, above(epoch, position, 2.2, look_at="moon")), 0.97)


def stars(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of Orion from the night side."""
    scene = above("2026-11-15T20:20:00Z", (8.0, -4.0, 420.0), 45.0, azimuth_deg=94.0, off_nadir_deg=88.0)
    return film(glare(radiance(renderer, scene)), 1.5e-4, contrast=0.0)


def ice(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of the North Atlantic in March."""
    scene = above("2026-03-20T12:00:00Z", (56.0, -20.0, 30000.0), 24.0)
    return exposed(radiance(renderer, scene), 0.98)


def seasons(renderer: fa.Renderer) -> np.ndarray:
    """Return the views of Europe at noon in January, April, July and October."""
    tiles = []
    half = (SIZE[0] // 2, SIZE[1] // 2)
    for month in ("01", "04", "07", "10"):
        world = Environment(clouds=False)
        scene = above(f"2026-{month}-15T11:00:00Z", (49.0, 14.0, 2500.0), 42.0, half, environment=world)
        tiles.append(exposed(radiance(renderer, scene), 0.985, -0.9))
    return np.vstack([np.hstack(tiles[:2]), np.hstack(tiles[2:])])


def earthrise(renderer: fa.Renderer) -> np.ndarray:
    """Return the view of earthrise from 110 km above the Moon."""
    epoch = "2026-12-13T12:00:00Z"
    now = Instant.from_utc(epoch)
    moon = moon_eci_m(now.tt1, now.tt2).reshape(3)
    scene = above(epoch, (0.0, 0.0, 400.0), 20.0)
    to_earth = -moon / np.linalg.norm(moon)
    sun = np.asarray(scene.r_sun_eci_m) / np.linalg.norm(scene.r_sun_eci_m)
    side = np.cross(to_earth, np.cross(sun, to_earth))
    side = -np.cross(to_earth, np.array([0.0, 0.0, 1.0])) if np.linalg.norm(side) < 0.1 else side
    up = side / np.linalg.norm(side)
    # up is towards the Sun; the Earth is 3 degrees above the Moon's horizon, 19.9 degrees below the horizontal
    up = up - (up @ to_earth) * to_earth
    up /= np.linalg.norm(up)
    # a low Sun, for shadows in the craters
    turn = np.radians(72.0)
    up = np.cos(turn) * up + np.sin(turn) * np.cross(to_earth, up)
    tilt = np.radians(-16.5)
    zenith = np.cos(tilt) * up + np.sin(tilt) * to_earth
    r = moon + 1_847_400.0 * zenith
    level = to_earth - (to_earth @ zenith) * zenith
    level /= np.linalg.norm(level)
    look = np.cos(np.radians(19.0)) * level - np.sin(np.radians(19.0)) * zenith
    x = np.cross(look, zenith)
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(look, x), look])
    scene = replace(
        scene,
        r_camera_eci_m=vec3(r),
        r_target_eci_m=vec3(r - 1000 * look),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(R)),
        central_body="moon",
    )
    return exposed(radiance(renderer, scene), 0.997)


PICTURES: tuple[tuple[str, Picture, str], ...] = (
    ("noon", noon, "Noon over Egypt: the Nile, Sinai and the Red Sea from 420 km, 20 March"),
    ("terminator", terminator, "The Sun's glint and the clouds near the terminator, North Atlantic"),
    ("night", night, "City lights of Italy, clouds over the Alps in the light of the full Moon"),
    ("glint", glint, "Sun glint on the Aegean, an afternoon in June"),
    ("shallows", shallows, "The Great Bahama Bank: white sand under a few metres of water"),
    ("limb", limb, "Layers of the limb through a long lens: clouds, haze, blue air, the dark"),
    ("eclipse-entry", eclipse_entry, "Tango before the limb in the last half minute of sunlight"),
    ("moon", moonrise, "The Moon over the limb"),
    ("stars", stars, "Orion: stars in calibrated flux and colour, moved to the date"),
    ("seasons", seasons, "Central Europe without clouds: January, April, July, October"),
    ("ice", ice, "Clouds, snow and the sea's ice of March from 30,000 km"),
    ("earthrise", earthrise, "The Earth from 110 km above the Moon"),
)
PHYSICS = """
Sand reflects 0.38 above the air, almost evenly over the Sun's height (Libya 4); bare relief is lit by its slopes;
water is dark but for Fresnel's two per cent. Dry valleys are noise that rivers cut (Rinaldo et al. 1992).

Low sunlight has lost its blue over the long way through air. Cloud returns light by its optical depth (Kokhanovsky &
Nauss 2006); in `high` it is groups of round puffs with borders as ragged as measured (Lovejoy 1982), deeper where they
are wide (Zhao & Di Girolamo 2007), with valleys and far sides in shade.

Lamps of sodium and white diodes (Small 2022) keep the mean of the map's cells, which is what VIIRS has over 50 km
(Elvidge et al. 2017); 15 % of their light is scattered by the air. The full Moon lights clouds at a 400,000th of the
Sun (Allen 2000). The grey band above the limb is airglow, to 100 km (Leinert et al. 1998).

Slopes of waves for 6 m/s mirror the Sun (Cox & Munk 1954). `high` changes their variance by region, gust, streak and
film (Munk et al. 2000), with its mean kept, and calms the lee of coasts.

Sand under clear water adds what the August map has over deep sea; red is absorbed within metres, so that banks are
turquoise.

Near the ground the path is so deep that all bands come back alike; higher up it is thin and as blue as its
scattering (Bodhaine et al. 1999), with the density of the U.S. Standard Atmosphere (1976).

The Sun behind the air is dimmed, reddened and flattened; the craft has the same light. The arch is orange at its base
and blue above by ozone (Hulburt 1953). Glare is the lens's, of a detector that clips.

Lommel-Seeliger's law with the measured phase curve (Allen 2000, Buratti et al. 1996): no darkening towards the limb of
a full Moon. The air in front adds its blue and, by refraction, flattens the lower limb.

Every star has its catalogued flux in the bands (Hipparcos, Pickles 1998), whatever the size of a pixel: Betelgeuse is
orange, Rigel blue.

The month's reflectance over August's, from maps of 20 km (NASA); snow is white whatever grows under it. Where a sea
shines in spring and summer, it mirrors the Sun.

The month's extent of the ice (NSIDC), 0.62 bright where the pack is closed (Perovich et al. 2002); tongues and floes by
noise.

Craters of all ages, worn by diffusion (Fassett & Thomson 2014), numbers falling with the square of the diameter (Minton
et al. 2019). A wall that faces away from the Sun is dark.
"""
"""One paragraph for each picture."""


def write_jpeg(path: Path, rgb: np.ndarray) -> None:
    """Write an image at the highest quality whose size is within `LARGEST_BYTES`."""
    image = np.ascontiguousarray(rgb[..., ::-1])
    for quality in (JPEG, 70, 55, 40):
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) <= LARGEST_BYTES:
            break
    path.write_bytes(data)


def main(names: list[str] | None = None) -> None:
    """Render and write every image, or the named ones, and the page."""
    folder = DOCS / "images" / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Gallery",
        "",
        "Made by `python -m tools.docs.gallery`: radiance in physical units, one tone curve and grain, preset `high`.",
        "Sources: [sky](sky.md).",
    ]
    with fa.Renderer() as renderer:
        for (name, picture, caption), physics in zip(PICTURES, PHYSICS.strip().split("\n\n"), strict=True):
            path = folder / f"{name}.jpg"
            if not names or name in names:
                write_jpeg(path, picture(renderer))
            lines += ["", f"## {caption}", "", f"![{name}](images/gallery/{name}.jpg)", "", physics]
    (DOCS / "gallery.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
