"""Textures in the image: reflectance, position, normals, and decoding by OpenCV."""

import hashlib
from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import TextureImage
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_rotvec
from tools.craft.charuco import charuco_board, model_from_opencv_m

pytestmark = pytest.mark.gl
SHADOWLESS = (0.3, 0.2, -1.0)


def png(rgb):
    """A PNG of (H, W, 3) RGB."""
    return cv2.imencode(".png", np.asarray(rgb, np.uint8)[..., ::-1])[1].tobytes()


def srgb(linear):
    return np.rint(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def textured(draw_kit, picture, **names):
    """A plate towards the camera whose texture's u runs to the right and v down in the image."""
    material = draw_kit.white(base_color=(0.9, 0.8, 0.7), **dict.fromkeys(names["kinds"], "p"))
    material = replace(material, **names.get("changes", {}))
    part = draw_kit.plate("p", "white", (0, 0, 0), 0.5)
    part = replace(part, uv=(part.positions_m[:, :2] + 0.5).astype(np.float32))
    target = draw_kit.target([part], [material])
    digest = hashlib.sha256(target.sha256.encode() + picture).hexdigest()
    return replace(target, pictures=(TextureImage(name="p", data=picture),), sha256=digest)


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_a_texture_reflects_as_a_material_of_its_colours(renderer, draw_kit, bands):
    colours = np.array([[(0.1, 0.5, 0.9), (0.6, 0.3, 0.05)], [(0.02, 0.02, 0.02), (1.0, 1.0, 1.0)]])
    target = textured(draw_kit, png(np.kron(srgb(colours), np.ones((8, 8, 1)))), kinds=["base_color_texture"])
    scene = draw_kit.scene(target, sun_camera=SHADOWLESS, bands=bands)
    image = renderer.render(scene, target).radiance
    for row, column in np.ndindex(2, 2):
        x, y = np.rint(
            scene.camera.project(np.array([[column - 0.5, row - 0.5, 0]]) * 0.5 + (0, 0, 5))
        ).astype(int)[0]
        plain = draw_kit.target(
            [draw_kit.plate("p", "white", (0, 0, 0), 0.5)],
            [draw_kit.white(base_color=tuple(colours[row, column] * (0.9, 0.8, 0.7)))],
        )
        plain_scene = draw_kit.scene(plain, sun_camera=SHADOWLESS, bands=bands)
        expected = renderer.render(plain_scene, plain).radiance[y, x]
        # eight bits of sRGB: 1.5 % of a reflectance of 0.02
        assert image[y, x] == pytest.approx(expected, rel=0.015)


def test_untextured_parts_are_unchanged_by_textures_of_others(renderer, draw_kit):
    target = textured(draw_kit, png(np.full((2, 2, 3), 255)), kinds=["base_color_texture"])
    plain = replace(draw_kit.plate("q", "grey", (0.9, 0, 0), 0.3), uv=None)
    grey = draw_kit.white(name="grey", base_color=(0.2, 0.3, 0.4), metallic=0.3, roughness=0.4)
    both = replace(target, parts=(*target.parts, plain), materials=(*target.materials, grey), sha256="b" * 64)
    alone = draw_kit.target([plain], [grey])
    images = [
        renderer.render(draw_kit.scene(t, sun_camera=SHADOWLESS, bands="rgb"), t).radiance
        for t in (both, alone)
    ]
    x = round(161.3 + 600 * 0.9 / 5)
    assert images[0][118, x] == pytest.approx(
        images[1][118, x], rel=6e-3
    )  # normals in half floats or 12 bits


def test_maps_of_metalness_and_roughness(renderer, draw_kit):
    target = textured(
        draw_kit,
        png(np.full((4, 4, 3), (255, 128, 204))),
        kinds=["metallic_roughness_texture"],
        changes={"metallic": 1.0, "roughness": 0.8},
    )
    plain = draw_kit.target(
        [draw_kit.plate("p", "white", (0, 0, 0), 0.5)],
        [draw_kit.white(base_color=(0.9, 0.8, 0.7), metallic=0.8, roughness=0.8 * 128 / 255)],
    )
    images = [
        renderer.render(draw_kit.scene(t, sun_camera=(0.1, 0, -1)), t).radiance[118, 161]
        for t in (target, plain)
    ]
    assert images[0] == pytest.approx(images[1], rel=5e-3)


@pytest.mark.parametrize("turn", [0.0, 1.3, -2.5])
@pytest.mark.parametrize("lean", [(0.4, 0.0), (0.0, 0.4)])
def test_normals_of_a_texture_lean_the_surface(renderer, draw_kit, turn, lean):
    n = np.array([*lean, np.sqrt(1 - lean[0] ** 2 - lean[1] ** 2)])
    picture = png(np.full((4, 4, 3), np.rint(127.5 * (n + 1))))
    target = textured(draw_kit, picture, kinds=["normal_texture"])
    flat = textured(draw_kit, png(np.full((4, 4, 3), (128, 128, 255))), kinds=["normal_texture"])
    R = matrix_from_quat(quat_from_rotvec(np.array([0, 0, turn])))
    # red leans to the picture's right (x of the plate), green to its top (-y), blue out of it (-z)
    normal, sun = R @ np.array([n[0], -n[1], -n[2]]), np.array([0.5, -0.3, -1.0])
    sun /= np.linalg.norm(sun)
    values = [
        renderer.render(draw_kit.scene(t, sun_camera=sun, rotvec_rad=(0, 0, turn)), t).radiance[118, 161]
        for t in (target, flat)
    ]
    # rough white: Lambert's law within the few per cent that the Fresnel coat takes
    assert values[0] / values[1] == pytest.approx((normal @ sun) / -sun[2], rel=0.05)


@pytest.mark.parametrize("rotvec", [(np.pi, 0, 0), (np.pi - 0.5, 0.3, 0.2), (2.2, -1.5, 0.9)])
def test_opencv_finds_the_charuco_board_where_it_is(renderer, draw_kit, rotvec):
    board = load_target("calibration-board")
    camera = replace(
        draw_kit.camera, width_px=640, height_px=480, fx_px=1000.0, fy_px=1000.0, cx_px=318.3, cy_px=241.6
    )
    scene = draw_kit.scene(
        board, camera=camera, t_m=(0.01, -0.02, 0.95), rotvec_rad=rotvec, sun_camera=(-0.3, 0.4, -1)
    )
    radiance = renderer.render(scene, board).radiance
    image = np.clip(radiance / radiance.max() * 230, 0, 255).astype(np.uint8)
    found, ids, markers, marker_ids = cv2.aruco.CharucoDetector(charuco_board()).detectBoard(image)
    assert len(marker_ids) >= 40
    assert len(ids) >= 66
    points = model_from_opencv_m(np.asarray(charuco_board().getChessboardCorners()))[ids.ravel()]
    keypoints = {k.name: k.position_m for k in board.keypoints}
    named = [keypoints[f"corner_{k // 10}_{k % 10}"] for k in ids.ravel()]
    assert np.allclose(points, named, atol=1e-6)
    at = camera.project(scene.camera_from_target.apply(points))
    error = np.asarray(found).reshape(-1, 2) - at
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.12  # of OpenCV's own corner finder
    assert np.abs(error.mean(axis=0)).max() < 0.03
    # the markers' own corners are texture: nothing shifts it against the squares
    seen = np.concatenate([np.asarray(m).reshape(4, 2) for m in markers])
    where = np.concatenate([np.asarray(charuco_board().getObjPoints())[int(k)] for k in marker_ids.ravel()])
    off = seen - camera.project(scene.camera_from_target.apply(model_from_opencv_m(where)))
    assert np.abs(off.mean(axis=0)).max() < 0.25


def test_error_names_a_damaged_image(renderer, draw_kit):
    target = textured(draw_kit, b"\x89PNG nothing", kinds=["base_color_texture"])
    with pytest.raises(UserError, match="texture 'p' of target test is damaged"):
        renderer.render(draw_kit.scene(target), target)
