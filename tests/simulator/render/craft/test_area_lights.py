"""Area lights in images: radiance of lit faces against integrals, soft shadows, scenes without lights."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.imaging.metering import metered_radiance_w_m2_sr
from flyaround.simulator.labels.keypoints import geometric_states
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scene.illumination.area_light import AreaLight
from flyaround.simulator.scene.record import SceneRecord
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target

pytestmark = pytest.mark.gl
L = 100.0


def dark(scene, *lights):
    environment = msgspec.structs.replace(scene.environment, sunlight=False)
    return replace(scene, environment=environment, lights=lights)


def integrated(material, placed, p, n, v):
    """Radiance of a face by sums over the light: GGX, correlated Smith and Schlick, Lambert below."""
    s = (np.arange(400) + 0.5) / 200 - 1
    u, w = (x.ravel()[:, None] for x in np.meshgrid(s, s))
    d = placed.middle_m + u * placed.right_m + w * placed.down_m - p
    square = (d * d).sum(axis=1)
    l = d / np.sqrt(square)[:, None]
    n_l, leaving = np.clip(l @ n, 0, None), np.clip(-(l @ placed.axis), 0, None)
    falling = n_l * leaving / square * placed.area_m2 / len(d)
    h = (l + v) / np.linalg.norm(l + v, axis=1)[:, None]
    n_h, v_h, n_v, a2 = h @ n, h @ v, n @ v, material.roughness**4
    base = material.base_color[0]
    f0 = 0.04 + (base - 0.04) * material.metallic
    distribution = a2 / (np.pi * ((n_h * a2 - n_h) * n_h + 1) ** 2)
    masking = 0.5 / (n_l * np.sqrt((n_v - n_v * a2) * n_v + a2) + n_v * np.sqrt((n_l - n_l * a2) * n_l + a2))
    fresnel = f0 + (1 - f0) * (1 - v_h) ** 5
    lobe = float((falling * fresnel * distribution * masking).sum())
    below = base * (1 - material.metallic) / np.pi * float(((1 - fresnel) * falling).sum())
    return L * lobe, L * below


@pytest.mark.parametrize(
    ("metallic", "roughness", "place", "close"),
    [
        (0.0, 1.0, (0.6, -0.4, 3.4), 0.06),  # rough: several bounces between facets are in the picture alone
        (0.0, 0.5, (1.2, 0.0, 3.0), 0.03),
        (1.0, 0.5, (1.5, 0.5, 3.2), 0.12),  # seen beside the mirror's direction
        (1.0, 0.3, (0.2, 0.1, 2.5), 0.06),  # mirrored
        (1.0, 0.1, (0.0, 0.0, 2.5), 0.03),
        (1.0, 0.25, (3.2, 0.0, 4.2), 0.12),  # nearly grazing
    ],
)
def test_plate_radiance_equals_the_sum_over_the_light(renderer, draw_kit, metallic, roughness, place, close):
    material = draw_kit.white(metallic=metallic, roughness=roughness, base_color=(0.6,) * 3)
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.4)], [material])
    light = AreaLight(
        position_m=place,
        direction=tuple(np.array([0.0, 0.0, 5.0]) - place),
        width_m=0.8,
        height_m=0.5,
        radiance_w_m2_sr=L,
    )
    scene = dark(draw_kit.scene(target), light)
    p = np.array([0.0, 0.0, 5.0])
    placed, towards = light.in_camera_frame(scene.camera_from_target), np.array([0, 0, -1.0])
    lobe, below = integrated(material, placed, p, towards, towards)
    seen = float(renderer.render(scene, target).radiance[119, 161])
    assert seen == pytest.approx(lobe + below, rel=close)
    # the meter's sum, which knows of no gloss
    factor = placed.irradiance_factor(p[None], towards[None], 64)
    assert factor[0] * L * 0.6 * (1 - metallic) / np.pi == pytest.approx(below * 1.04, rel=0.06, abs=1e-6)


def test_mirror_image_of_a_light_box_has_its_size(renderer, draw_kit):
    material = draw_kit.white(metallic=1.0, roughness=0.06, base_color=(0.9,) * 3)
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.9)], [material])
    light = AreaLight(position_m=(0, 0, -5.0), width_m=2.0, height_m=1.0, radiance_w_m2_sr=L)
    row = renderer.render(dark(draw_kit.scene(target), light), target).radiance[119]
    assert row[161] == pytest.approx(0.9 * L, rel=0.02)
    # 10 m of way from the box, 5 of them from the mirror: half its size on the plate, blurred at its edges
    across = np.flatnonzero(row > 0.45 * L)
    x = (across[[0, -1]] - 161.3) / 600 * 5
    assert x == pytest.approx([-0.333, 0.333], abs=0.02)


def test_the_penumbra_of_an_edge_is_as_wide_as_the_light(renderer, draw_kit):
    # a shade half a metre before a wall, a light two metres before the shade: the penumbra is a quarter of the light
    parts = [
        draw_kit.plate("wall", "white", (0, 0, 0), 0.6),
        draw_kit.plate("shade", "white", (-0.5, 0, -0.5), 0.3),
    ]
    target = draw_kit.target(parts, [draw_kit.white()])
    light = AreaLight(
        position_m=(-0.8, 0, 2.5), direction=(0, 0, 1.0), width_m=0.6, height_m=0.02, radiance_w_m2_sr=L
    )
    scene = dark(draw_kit.scene(target), light)
    open_wall = draw_kit.target(parts[:1], [draw_kit.white()])
    open_scene = dark(draw_kit.scene(open_wall), light)
    row = renderer.render(scene, target).radiance[119] / np.maximum(
        renderer.render(open_scene, open_wall).radiance[119], 1e-6
    )
    x = (np.arange(320) - 161.3) / 600 * 5
    # the shade's edge at x = -0.2 falls at -0.05 +- 0.075 from the light's ends, which are at -0.8 +- 0.3
    for at, share in ((-0.14, 0.0), (-0.09, 0.23), (-0.05, 0.5), (-0.01, 0.77), (0.04, 1.0)):
        assert np.interp(at, x, row) == pytest.approx(share, abs=0.09)


def test_light_fixed_to_the_target_rotates_with_it(renderer, draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.4)], [draw_kit.white()])
    fixed = AreaLight(position_m=(0.5, 0.3, -1.5), frame="target", radiance_w_m2_sr=L)
    plain = renderer.render(dark(draw_kit.scene(target), fixed), target).radiance[119, 161]
    turned = renderer.render(dark(draw_kit.scene(target, rotvec_rad=(0, 0, 1.2)), fixed), target).radiance[
        119, 161
    ]
    assert plain > 0
    assert turned == pytest.approx(plain, rel=0.02)


def test_scene_without_lights_is_unchanged_and_dark_without_sun(renderer, draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.4)], [draw_kit.white()])
    scene = draw_kit.scene(target)
    assert "lights" not in msgspec.json.decode(msgspec.json.encode(SceneRecord.from_scene(scene)))
    before = renderer.render(scene, target).radiance
    lit = dark(scene, AreaLight(position_m=(0, 0, 3.0), radiance_w_m2_sr=L))
    assert renderer.render(lit, target).radiance[119, 161] > 0
    assert np.array_equal(renderer.render(scene, target).radiance, before)
    assert not renderer.render(dark(scene), target).radiance.any()
    assert msgspec.json.decode(msgspec.json.encode(lit), type=type(lit)) == lit
    assert (
        metered_radiance_w_m2_sr(lit, target, 0.9) > metered_radiance_w_m2_sr(dark(scene), target, 0.9) == 0
    )


def test_keypoints_in_a_room_are_never_eclipsed(draw_kit):
    tango = load_target("tango-mockup")
    scene = draw_kit.scene(tango, t_m=(0, 0, 8.0))
    states = geometric_states(
        dark(scene, AreaLight(position_m=(0, 0, 3.0), radiance_w_m2_sr=L)), tango, joined_mesh(tango)
    )
    assert None in states
    assert not {"eclipsed", "shadowed"} & set(states)
    assert "eclipsed" in geometric_states(dark(scene), tango, joined_mesh(tango))


def test_light_boxes_are_drawn_about_the_craft_and_shine_at_it():
    plan = plan_recipe("lightbox", 30, seed=3)
    scenes = [plan.scene(k) for k in range(30)]
    ranges = plan_recipe("lightbox", 1).recipe.vary.boxes
    for scene in scenes:
        assert len(scene.area_lights) == scene.sample.varied.boxes
        assert not scene.environment.sunlight
        for light in scene.area_lights:
            to = np.asarray(light.position_m) - scene.t_camera_from_target_m
            distance = np.linalg.norm(to)
            assert ranges.distance_m[0] <= distance <= ranges.distance_m[1]
            camera = -np.asarray(scene.t_camera_from_target_m)
            cosine = to @ camera / distance / np.linalg.norm(camera)
            assert cosine > np.cos(np.radians(ranges.max_angle_deg)) - 1e-9
            towards = light.in_camera_frame(scene.camera_from_target).axis
            assert np.linalg.norm(np.cross(-to, towards)) <= ranges.aim_error_m + 1e-9
    assert {len(s.area_lights) for s in scenes} == {1, 2, 3}
    assert scenes == [plan_recipe("lightbox", 40, seed=3).scene(k) for k in range(30)]
