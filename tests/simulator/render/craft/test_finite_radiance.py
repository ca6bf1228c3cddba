"""Radiance is finite for degenerate faces, normals, texture coordinates and materials."""

import hashlib
from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.simulator.errors import UserError
from flyaround.simulator.scene.illumination.area_light import AreaLight
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.targets.model import Material, Part, TextureImage

pytestmark = pytest.mark.gl

OCTAHEDRON = (
    np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float),
    np.array([(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]),
)
CUBE = (
    np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float),
    np.array(
        [
            *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
            *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
        ]
    ),
)
TRIANGLE = (np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0.2)], float), np.array([(0, 2, 1)]))
NEEDLES = (
    np.array([(-1, 0, 0), (1, 1e-6, 0), (0, 1, 0.5), (1, 1e-3, 0.1)], float),
    np.array([(0, 1, 2), (0, 3, 1)]),
)
FACE_OF_NO_AREA = (OCTAHEDRON[0], np.concatenate([OCTAHEDRON[1], [(0, 0, 2), (1, 1, 1)]]))
SHAPES = {}
TWO_SIDED = (OCTAHEDRON[0], np.concatenate([OCTAHEDRON[1], OCTAHEDRON[1][:, ::-1]]))

SHAPES = {
    "octahedron": OCTAHEDRON,
    "cube": CUBE,
    "one triangle": TRIANGLE,
    "needles": NEEDLES,
    "faces of no area": FACE_OF_NO_AREA,
    "both sides": TWO_SIDED,
}
NORMALS = {
    "smooth": lambda n: n,
    "zero": lambda n: 0 * n,
    "inwards": lambda n: -n,
    "opposed": lambda n: n * np.where(np.arange(len(n)) % 2, 1, -1)[:, None],
    "one way": lambda n: np.tile((0.0, 0.0, 1.0), (len(n), 1)),
}
UV = {
    "planar": lambda p: 0.5 + 0.5 * p[:, :2],
    "mirrored": lambda p: 0.5 - 0.5 * p[:, :2] * (1, -1),
    "one point": lambda p: np.full((len(p), 2), 0.25),
    "one line": lambda p: np.repeat(p[:, :1], 2, axis=1),
    "far out": lambda p: 1e6 * p[:, :2],
    "none": lambda p: None,
}
ALL_TEXTURES = ("base_color_texture", "metallic_roughness_texture", "normal_texture")
PICTURE = cv2.imencode(".png", np.random.default_rng(3).integers(0, 256, (8, 8, 3), np.uint8))[1].tobytes()


def craft(draw_kit, shape="octahedron", *, uv="planar", normals="smooth", textures=ALL_TEXTURES, **material):
    """A solid of a few triangles whose corners share their normals, with textures."""
    points, triangles = SHAPES[shape]
    given = NORMALS[normals](points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-9))
    across = UV[uv](points)
    part = Part(
        name="solid",
        material="paint",
        positions_m=points.astype(np.float32),
        normals=given.astype(np.float32),
        triangles=triangles,
        uv=None if across is None else across.astype(np.float32),
    )
    paint = Material(
        **{"name": "paint", "base_color": (0.8, 0.7, 0.6)} | material, **dict.fromkeys(textures, "picture")
    )
    target = draw_kit.target([part], [paint])
    digest = hashlib.sha256(repr((target.sha256, normals, uv, triangles.tolist())).encode())
    picture = TextureImage(name="picture", data=PICTURE)
    return replace(target, pictures=(picture,) if textures else (), sha256=digest.hexdigest())


def views(draw_kit, target, quality):
    """Scenes around a target: the Sun before, beside and behind it, a lamp and a lit box, one band and three."""
    camera = replace(
        draw_kit.camera, width_px=96, height_px=80, fx_px=150.0, fy_px=150.0, cx_px=48.0, cy_px=40.0
    )
    box = AreaLight(position_m=(0.5, 0.2, 3.0), width_m=0.3, height_m=0.3, radiance_w_m2_sr=100.0)
    lit = {"lamp": Lamp(power_w=50.0), "lights": (box,)}
    for k, (sun, more) in enumerate(
        [
            ((0.4, -0.3, -1.0), {}),
            ((1.0, 0.0, 0.0), {"bands": "rgb"}),
            ((0.0, 0.0, 1.0), {}),
            ((0.0, 0.5, -1.0), lit),
        ]
    ):
        yield draw_kit.scene(
            target,
            t_m=(0.0, 0.0, 5.0),
            rotvec_rad=(0.7 * k, 0.3 * k, -0.2 * k),
            sun_camera=sun,
            camera=camera,
            quality=quality,
            **more,
        )


def assert_finite(renderer, draw_kit, target, quality):
    for scene in views(draw_kit, target, quality):
        drawn = renderer.render(scene, target)  # raises where a pixel's radiance is not a number
        assert np.isfinite(drawn.radiance).all()
        assert drawn.radiance.min() >= 0
        layers = renderer.surfaces(scene, target, layers=True)
        seen = np.isfinite(layers.depth_m)
        assert np.linalg.norm(layers.normals[seen], axis=1) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("shape", "quality"),
    [
        ("octahedron", "draft"),
        ("cube", "default"),
        ("octahedron", "high"),
        pytest.param("cube", "draft", marks=pytest.mark.slow),
        pytest.param("octahedron", "default", marks=pytest.mark.slow),
        pytest.param("cube", "high", marks=pytest.mark.slow),
    ],
)
def test_smooth_normals_with_a_texture_on_a_coarse_solid(renderer, draw_kit, shape, quality):
    target = craft(draw_kit, shape, textures=("base_color_texture",))
    assert_finite(renderer, draw_kit, target, quality)


def test_infinite_radiance_names_the_target(renderer, draw_kit):
    target = craft(draw_kit, textures=(), base_color=(3e38,) * 3)
    with pytest.raises(
        UserError, match="pixels of target test have no finite radiance in frame 0 at quality draft"
    ):
        assert_finite(renderer, draw_kit, target, "draft")


DEGENERATE = [
    *({"normals": normals} for normals in NORMALS),
    *({"uv": uv} for uv in UV),
    *({"shape": shape} for shape in SHAPES),
    *({"shape": "one triangle", "normals": normals, "uv": "one point"} for normals in NORMALS),
    *(
        {"base_color": (c, c, c), "metallic": m, "roughness": 0.0, "textures": ()}
        for c in (0.0, 1.0)
        for m in (0.0, 1.0)
    ),
    {"clearcoat": 1.0, "clearcoat_roughness": 0.0, "roughness": 0.0},
    {"crinkle": 1.0, "roughness": 0.0},
    {"crinkle": 1.0, "normals": "zero", "textures": ()},
    {"anisotropy": 1.0, "grain": (0.0, 0.0, 1.0), "roughness": 0.0},
    {"anisotropy": 1.0, "grain": (0.0, 0.0, 0.0), "turned": True},
]


@pytest.mark.slow
@pytest.mark.parametrize("quality", ["draft", "default", "high"])
@pytest.mark.parametrize("case", DEGENERATE, ids=str)
def test_degenerate_meshes_and_materials(renderer, draw_kit, case, quality):
    assert_finite(renderer, draw_kit, craft(draw_kit, **case), quality)


@pytest.mark.slow
def test_the_sheet_of_an_added_mesh_is_drawn_without_a_warning(tmp_path):
    """Warnings are errors in these tests."""
    (tmp_path / "t.png").write_bytes(PICTURE)
    (tmp_path / "o.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    points, triangles = OCTAHEDRON
    lines = ["mtllib o.mtl", "usemtl m", *(f"v {x} {y} {z}" for x, y, z in points)]
    lines += [*(f"vn {x} {y} {z}" for x, y, z in points), *(f"vt {x} {y}" for x, y, _ in points / 2 + 0.5)]
    lines += ["f " + " ".join(f"{k}/{k}/{k}" for k in triangle) for triangle in triangles + 1]
    (tmp_path / "o.obj").write_text("\n".join(lines) + "\n")
    assert run(["targets", "add", str(tmp_path / "o.obj"), "--units", "m", "--mass", "10"]) == 0
