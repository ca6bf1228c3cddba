"""Rows of the rendering page on spacecraft: surfaces, shadows, edges and skylight against exact integrals."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.lens.distortion import Distortion
from flyaround.simulator.dataset.check.geometry import project_with_opencv
from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.render.craft.finishes import has_films
from flyaround.simulator.scene.illumination.irradiance import basis, field_of_samples, uniform_field
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Material
from flyaround.simulator.world.constants import AU_M, SUN_RADIUS_M
from tools.validation.bare_scene import ball, bare_scene, bare_target, flat_plate, square_camera
from tools.validation.rendering import brushed as rendering_brushed
from tools.validation.rendering import lamp as rendering_lamp
from tools.validation.rendering.lit_ball import draw_lit_ball
from tools.validation.rendering.path_traced import Difference, difference, load, path_trace
from tools.validation.rows import Row

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray
    from flyaround.simulator.scene.state import Quality

SUN_RAD = SUN_RADIUS_M / AU_M
EDGE_ANGLES_DEG = tuple(2.5 * k for k in range(-36, 36))  # directions of the plate's edges
EDGE_CAMERA = square_camera(128, 600.0)
# principal point far off the image's middle, where the plate is: distortion bends its edges there
_LENS = replace(square_camera(128, 150.0), cx_px=-20.0, cy_px=0.0)
EDGE_CAMERAS = {
    "": EDGE_CAMERA,
    " through a Brown-Conrady lens": replace(
        _LENS, distortion=Distortion("brown_conrady", (-0.15, 0.03, 0.002, -0.001))
    ),
    " through a fisheye": replace(_LENS, distortion=Distortion("kannala_brandt", (0.03, -0.01, 0.002, 0.0))),
}
# depth step between neighbouring pixels, relative to a plane, at which one part ends in front of another
STEP_M = 0.01
MITSUBA_SKY_W_M2_SR = 30.0  # uniform sky, as bright as a sunlit Earth
# rotation vector of Tango [rad] and direction to the Sun, camera frame, for panel, bottom and a side; samples per pixel
# of Sun and sky for noise below 0.5 %: the side is mostly in shadow
MITSUBA_VIEWS = (
    ((2.4, 0.3, 0.2), (-1.0, -0.6, -0.9), 2560, 2560),
    ((0.4, 0.2, 0.1), (0.8, -0.5, -0.6), 2560, 2560),
    ((1.2, -1.4, 0.5), (-0.4, 0.9, -0.7), 2560, 4096),
)
NOTES = """
Edges: a plate wholly in the frame, true places by OpenCV's projection of 400 points of each edge. Through a lens,
straight pieces lie up to 0.02 px on the inner side (docs/adr/0017); where two meet, a sample may count for the wrong
one. Where the driver clips a mesh far outside it, one row in a thousand is up to 0.16 px off (docs/adr/0003).

Tango against Mitsuba: path traced to six bounces with the same mesh and glTF materials (cells have a coat of 0.9
here, so that both draw them without films and busbars), the Sun's disc as 32 points and an even sky. Compared pixels
are wholly on the target, one pixel from its silhouette, and above 2 % of the brightest. FLIP is HDR-FLIP (Andersson
et al. 2021) at 67 pixels a degree; its goal is ours. "No steps" also leaves out pixels beside a step of depth of more
than 1 cm. What is left in `high`: a frame's rim mirrored in the cells beside it, light between parts in crevices
narrower than a baked node (docs/adr/0009), and the Sun in the 1.4 mm gaps between cells. In `default` each surface in
a pixel is lit as at one point and the shadow map's texels are 1 to 3 mm, so the 95th percentile is required of `high`
alone.
"""


def rows(renderer: Renderer) -> list[Row]:
    """Measure and return every comparison.

    Raises
    ------
    UserError
        If Mitsuba is missing: a page without its rows would look complete.
    """
    load()
    return [*quick_rows(renderer), *edge_rows(renderer), *mitsuba_rows(renderer)]


def quick_rows(renderer: Renderer) -> list[Row]:
    """Return rows of surfaces, penumbra, furnace, earthshine, brushed metal and the chaser's lamp."""
    matt = Material(name="m", base_color=(0.5, 0.5, 0.5), roughness=1.0)
    metal = Material(name="m", base_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.3)
    return [
        _sphere(renderer, "matt sphere", matt),
        _sphere(renderer, "glossy metal sphere under the Sun's disc", metal),
        penumbra_row(renderer),
        _furnace(renderer),
        _even_earth(),
        *rendering_brushed.rows(renderer),
        *rendering_lamp.rows(renderer),
    ]


def edge_rows(renderer: Renderer) -> list[Row]:
    """Return rows of edges of every slope, for both presets."""
    return [*_edges(renderer, "default", 0.04, 0.1), *_edges(renderer, "high", 0.02, 0.05)]


def _sphere(renderer: Renderer, quantity: str, material: Material) -> Row:
    """Return the maximum error over a sphere's lit face relative to its maximum, the Sun's disc integrated."""
    drawn = draw_lit_ball(renderer, material, 128, 100)
    exact = np.mean([_gltf(material, drawn.normals, drawn.views, d) for d in drawn.sun], axis=0)
    exact *= drawn.irradiance_w_m2
    error = np.abs(drawn.radiance - exact).max() / exact.max()
    return Row(
        what=f"Radiance of a {quantity}",
        against="numeric integration",
        unit="1",
        goal=0.01,
        measured=float(error),
    )


def _gltf(material: Material, n: FloatArray, v: FloatArray, light: FloatArray) -> FloatArray:
    """Return the (N,) reflected radiance over irradiance: glTF 2.0, appendix B, with multiple scattering."""
    base, alpha2 = material.base_color[0], material.roughness**4
    h = v + light
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    n_l, n_v = np.clip(n @ light, 1e-9, None), np.clip((n * v).sum(axis=1), 1e-3, None)
    n_h, v_h = (n * h).sum(axis=1), (v * h).sum(axis=1)
    d = alpha2 / (np.pi * (n_h**2 * (alpha2 - 1) + 1) ** 2)
    visibility = 0.5 / (
        n_l * np.sqrt(n_v**2 * (1 - alpha2) + alpha2) + n_v * np.sqrt(n_l**2 * (1 - alpha2) + alpha2)
    )
    f0 = 0.04 + (base - 0.04) * material.metallic
    f = f0 + (1 - f0) * (1 - v_h) ** 5
    again = 1 + f0 * (1 / _directional_albedo(material.roughness, n_v) - 1)
    diffuse = (1 - f) * base * (1 - material.metallic) / np.pi
    return np.asarray((diffuse + f * d * visibility * again) * n_l)


def _directional_albedo(roughness: float, n_v: FloatArray) -> FloatArray:
    """Return the (N,) share of uniform light that a white rough mirror reflects in one bounce, by sampling normals."""
    nodes, count = np.linspace(0.02, 1, 40), 20_000
    i = np.arange(count) + 0.5
    u, turn, alpha2 = i / count, 2 * np.pi * ((i * 0.6180339887498949) % 1), roughness**4
    c = np.sqrt((1 - u) / (1 + (alpha2 - 1) * u))
    s = np.sqrt(1 - c * c)
    h = np.stack([s * np.cos(turn), s * np.sin(turn), c], axis=1)
    albedo = []
    for mu in nodes:
        v_h = h @ np.array([np.sqrt(1 - mu * mu), 0, mu])
        n_l = 2 * v_h * h[:, 2] - mu
        good = (n_l > 0) & (v_h > 0)
        n_l = np.clip(n_l, 1e-9, None)
        visibility = 0.5 / (
            n_l * np.sqrt(mu * mu * (1 - alpha2) + alpha2) + mu * np.sqrt(n_l**2 * (1 - alpha2) + alpha2)
        )
        albedo.append(float(np.where(good, 4 * visibility * n_l * v_h / np.clip(c, 1e-9, None), 0).mean()))
    return np.interp(n_v, nodes, albedo)


def penumbra_row(renderer: Renderer) -> Row:
    """Return the rms error over the penumbra of a straight edge 0.4 m above a wall."""
    height, size = 0.4, 96
    target = bare_target(
        [
            flat_plate("wall", (-0.5, 0.5), (-0.5, 0.5), 0.0),
            flat_plate("blind", (0.0, 0.45), (-0.5, 0.5), -height),
        ],
        [Material(name="m", base_color=(0.5, 0.5, 0.5), roughness=1.0)],
    )
    # a slanted Sun, because the blind would otherwise cover its own shadow
    slope, turn = 0.5, 0.2
    camera = square_camera(size, 20_000.0)
    edge_x = -slope * height
    scene = bare_scene(
        target,
        camera,
        (-edge_x * np.cos(turn), -edge_x * np.sin(turn), 5.0),
        (0, 0, turn),
        sun_camera=(slope * np.cos(turn), slope * np.sin(turn), -1.0),
        quality="high",
    )
    image = renderer.render(scene, target).radiance.astype(float)
    y, x = np.mgrid[:size, :size]
    transverse = ((x - camera.cx_px) * np.cos(turn) + (y - camera.cy_px) * np.sin(turn)) * 5.0 / camera.fx_px
    lit = image[transverse < -0.009].mean()
    # share of a disc beyond a chord, by the chord's angle from the centre; the Sun moves along x
    towards = np.asarray(scene.sun_direction_camera)
    angle = transverse * towards[2] ** 2 / height / SUN_RAD
    bounded = np.clip(angle, -1, 1)
    exact = 0.5 - (np.arcsin(bounded) + bounded * np.sqrt(1 - bounded**2)) / np.pi
    # means along the edge, whose slope covers every phase of the shadow map's texels
    bins = np.round(angle / 0.1).astype(int)
    error = [(image / lit - exact)[bins == k].mean() for k in range(-12, 13)]
    return Row(
        what="Light across the penumbra of a straight edge, mean along it, rms (`high`)",
        against="chord of the Sun's disc",
        unit="1",
        goal=0.01,
        measured=float(np.sqrt(np.mean(np.square(error)))),
    )


def _furnace(renderer: Renderer) -> Row:
    """Return the maximum deviation of white spheres from the radiance of a uniform sky."""
    worst = 0.0
    for metallic, roughness in ((1.0, 0.1), (1.0, 0.5), (1.0, 1.0), (0.0, 0.5)):
        white = Material(name="m", base_color=(1.0, 1.0, 1.0), metallic=metallic, roughness=roughness)
        target = bare_target([ball(0.5)], [white])
        scene = bare_scene(target, square_camera(96, 400.0), (0, 0, 5.0), sunlit=False)
        rendered = renderer.render(scene, target, labels=True, sky=uniform_field(np.array([7.0])))
        worst = max(
            worst, float(np.abs(rendered.radiance[np.asarray(rendered.coverage) > 0.999] / 7.0 - 1).max())
        )
    return Row(what="White furnace", against="the sky's radiance", unit="1", goal=0.01, measured=worst)


def _even_earth() -> Row:
    """Return the maximum relative error of irradiance on plates of every direction 500 km over a uniform Earth."""
    rim = float(np.sqrt(1 - (6371.0 / 6871.0) ** 2))
    directions = spherical_fibonacci(50_000, rim)
    angle = 2 * np.pi * (1 - rim) / len(directions)
    light = field_of_samples(directions, np.ones((len(directions), 1)), angle, rim, np.array([0.0, 0.0, 1.0]))
    plates = spherical_fibonacci(300)
    exact = np.clip(plates @ directions.T, 0, None).sum(axis=1) * angle
    error = np.abs((basis(plates, light.axis) @ light.irradiance_w_m2)[:, 0] - exact).max() / exact.max()
    return Row(
        what="Earth-shine of an even Earth on plates of every direction",
        against="numeric integration",
        unit="1",
        goal=0.01,
        measured=float(error),
    )


def edge_errors(
    renderer: Renderer,
    quality: Quality,
    angles_deg: ArrayLike = EDGE_ANGLES_DEG,
    camera: Camera = EDGE_CAMERA,
) -> FloatArray:
    """Return a plate's edge position by coverage minus OpenCV's, in every row or column that the edge crosses [px]."""
    size = EDGE_CAMERA.fx_px / camera.fx_px  # size of the plate, constant in the image
    middle = 5 * camera.unproject(np.array([(camera.width_px - 1) / 2, (camera.height_px - 1) / 2]))
    place = (middle[0] + 0.0137 * size, middle[1] + 0.0071 * size, 5.0)
    target = bare_target(
        [flat_plate("p", (0.0, 0.3 * size), (-0.4 * size, 0.4 * size), 0.0)],
        [Material(name="m", base_color=(0.5, 0.5, 0.5), roughness=1.0)],
    )
    errors = []
    for angle_deg in np.asarray(angles_deg, float):
        turn = np.radians(angle_deg)
        scene = bare_scene(target, camera, place, (0, 0, turn), quality=quality)
        cover = np.asarray(renderer.render(scene, target, labels=True).coverage, float)
        edge_m = np.linspace((0, -0.28 * size, 0), (0, 0.28 * size, 0), 400)
        pixels = project_with_opencv(
            camera, edge_m, scene.q_camera_from_target_wxyz, np.asarray(scene.t_camera_from_target_m)
        )
        a, b = pixels[0], pixels[-1]
        steep = abs(b[1] - a[1]) > abs(b[0] - a[0])
        along, over = (1, 0) if steep else (0, 1)
        cover = cover if steep else cover.T
        pixels = pixels if a[along] < b[along] else pixels[::-1]
        lines = np.arange(int(np.ceil(pixels[0, along])), int(pixels[-1, along]))
        true = np.interp(lines, pixels[:, along], pixels[:, over])
        for line, position in zip(lines, true, strict=True):
            start = int(position) - 8
            window = cover[line, start : start + 17]
            share = window.sum()
            errors.append(
                (start + 16.5 - share if window[-1] > window[0] else start - 0.5 + share) - position
            )
    return np.array(errors)


def _edges(renderer: Renderer, quality: Quality, rms_px: float, largest_px: float) -> list[Row]:
    rows = []
    for lens, camera in EDGE_CAMERAS.items():
        errors = edge_errors(renderer, quality, camera=camera)
        values = (
            ("rms", rms_px, np.sqrt(np.mean(errors**2))),
            # a sample between two segments of a distorted edge may be counted for the wrong one
            ("largest", 0.2 if lens and quality == "default" else largest_px, np.abs(errors).max()),
        )
        rows += [
            Row(
                what=f"Straight edges{lens}, `{quality}`, {name}",
                against="projection",
                unit="px",
                goal=goal,
                measured=float(value),
            )
            for name, goal, value in values
        ]
    return rows


def _beside_steps(depth_m: FloatArray) -> BoolArray:
    """Return (H, W) True for pixels on either side of a depth step."""
    bend = np.zeros(depth_m.shape)
    for axis in (0, 1):
        second_difference = np.abs(np.roll(depth_m, 1, axis) - 2 * depth_m + np.roll(depth_m, -1, axis))
        bend = np.maximum(bend, np.nan_to_num(second_difference, nan=np.inf))
    return np.asarray(bend > STEP_M)


def mitsuba_rows(renderer: Renderer, most_spp: int = 4096) -> list[Row]:
    """Compare Tango at 6 m in three views and two presets; return the worst view, and the reference's own noise.

    Parameters
    ----------
    renderer : Renderer
        Renderer.
    most_spp : int, optional
        Maximum number of samples per pixel for each of Sun and sky.
    """
    # busbars and films of cells exist in our shader only; below a coat of 0.9 it follows glTF
    target = load_target("tango")
    plain = tuple(replace(m, clearcoat=0.9) if has_films(m) else m for m in target.materials)
    digest = sha256(repr(plain).encode() + target.sha256.encode()).hexdigest()
    # nor does the reference have the wear that `high` adds to materials by their names
    bare = tuple(replace(m, name=f"bare {m.name}") for m in plain)
    parts = tuple(replace(part, material=f"bare {part.material}") for part in target.parts)
    target = replace(target, materials=bare, parts=parts, sha256=digest)
    pairs: dict[Quality, list[tuple[Difference, Difference]]] = {"high": [], "default": []}
    noise = []
    for rotvec, sun, *samples in MITSUBA_VIEWS:
        scene = bare_scene(target, square_camera(320, 1450.0), (0, 0, 6.0), rotvec, sun_camera=sun)
        traced = path_trace(scene, target, MITSUBA_SKY_W_M2_SR, *(min(n, most_spp) for n in samples))
        for quality, differences in pairs.items():
            rendered = renderer.render(
                replace(scene, quality=quality),
                target,
                labels=True,
                sky=uniform_field(np.array([MITSUBA_SKY_W_M2_SR])),
            )
            coverage = np.asarray(rendered.coverage, float)
            # the uniform sky is behind the craft too
            radiance = np.asarray(rendered.radiance, float) + (1 - coverage) * MITSUBA_SKY_W_M2_SR
            full = np.pad(coverage > 0.999, 1)
            inner = np.all([np.roll(full, s, axis=a) for a in (0, 1) for s in (-1, 0, 1)], axis=0)[1:-1, 1:-1]
            covered = inner & ~_beside_steps(np.asarray(rendered.depth_m, float))
            differences.append(
                (difference(radiance, traced.radiance, inner), difference(radiance, traced.radiance, covered))
            )
        noise.append(float(np.mean((traced.noise / traced.radiance)[inner])))
    against = f"Mitsuba 3, {' + '.join(str(min(n, most_spp)) for n in MITSUBA_VIEWS[0][2:])} samples or more"
    out = [
        Row(
            what="Noise of the path-traced Tango, mean over it",
            against="spread of its passes",
            unit="1",
            goal=0.005,
            measured=max(noise),
        )
    ]
    for quality, differences in pairs.items():
        limits = {
            "relative radiance, median": 0.03,
            "95th percentile": 0.10,
            "95th percentile, no steps": 0.10,
            "FLIP over the whole picture": 0.05,
        }
        worst = (
            max(d.median for d, _ in differences),
            max(d.p95 for d, _ in differences),
            max(d.p95 for _, d in differences),
            max(d.flip for d, _ in differences),
        )
        out += [
            Row(
                what=f"Tango at 6 m, `{quality}`, {name}, worst of three views",
                against=against,
                unit="1",
                goal=goal,
                measured=value,
                asked=quality == "high" or "95th" not in name,
            )
            for (name, goal), value in zip(limits.items(), worst, strict=True)
            if np.isfinite(value)
        ]
    return out
