"""Edges pixel by pixel: the weight of each sample matches the side on which the rasteriser drew it."""

from dataclasses import replace

import numpy as np
import pytest

pytestmark = pytest.mark.gl
HALF_M = 0.45
CORNERS_M = np.array([(-HALF_M, -HALF_M, 0), (-HALF_M, HALF_M, 0), (HALF_M, HALF_M, 0), (HALF_M, -HALF_M, 0)])


def _area_inside(n, d):
    """Area of unit squares on the far side of lines with unit normal n, their centres at d along it (K,)."""
    width, height = np.maximum(np.abs(n), 1e-9)
    t = d + 0.5 * (width + height)
    q = [np.maximum(t - less, 0.0) ** 2 for less in (0, width, height, width + height)]
    return np.clip((q[0] - q[1] - q[2] + q[3]) / (2 * width * height), 0.0, 1.0)


# A sample weighed for the wrong side is off by its share of the pixel or a good part of it, 0.2, 0.14 and 0.02 px2 at
# least; corners rounded to 1/256 of a sample's distance, by 0.0017.
@pytest.mark.parametrize("quality", ["draft", "default", "high"])
def test_each_pixel_at_an_edge_shows_the_area_inside(renderer, draw_kit, quality):
    # long edges, all in the picture: a driver's interpolation along them was once off by a part in ten thousand
    camera = replace(
        draw_kit.camera, width_px=800, height_px=760, fx_px=2600.0, fy_px=2600.0, cx_px=399.3, cy_px=380.4
    )
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), HALF_M)], [draw_kit.white()])
    y, x = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
    pixels = np.stack([x, y], axis=-1).astype(float)
    rng = np.random.default_rng(7)
    errors, seen = [], 0
    for _ in range(12):
        scene = draw_kit.scene(
            target,
            rotvec_rad=(*rng.uniform(-0.3, 0.3, 2), rng.uniform(0, 2 * np.pi)),
            t_m=(*rng.uniform(-0.02, 0.02, 2), 5),
            quality=quality,
            camera=camera,
        )
        coverage = renderer.render(scene, target, labels=True).coverage.astype(float)
        corners = camera.project(scene.camera_from_target.apply(CORNERS_M))
        assert np.all((corners > 1) & (corners < [camera.width_px - 2, camera.height_px - 2]))
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            length = np.linalg.norm(end - start)
            along = (end - start) / length
            n = np.array([-along[1], along[0]])
            n *= np.sign(n @ (corners.mean(axis=0) - start))
            d, place = (pixels - start) @ n, (pixels - start) @ along
            at_edge = (np.abs(d) < 0.75) & (place > 3) & (place < length - 3)
            shown = coverage[at_edge]
            # in `high` a sliver that no sample meets is not shown; else the next one beyond it stands for it
            met = (shown > 1e-6) & (shown < 1 - 1e-6) if quality == "high" else np.ones(len(shown), bool)
            errors.append((shown - _area_inside(n, d[at_edge]))[met])
            seen += np.count_nonzero(at_edge)
    errors = np.concatenate(errors)
    assert len(errors) > 0.5 * seen
    assert np.abs(errors).max() < 0.003


def test_an_edge_that_reaches_far_beyond_the_picture_is_where_it_should(renderer, draw_kit):
    # its ends are further than whole numbers of the rasteriser's steps are counted: a piece of it is weighed
    half_m = 200.0
    target = draw_kit.target([draw_kit.plate("p", "white", (half_m, 0, 0), half_m)], [draw_kit.white()])
    errors = []
    for angle in np.radians([0.0, 12.0, 33.0, 58.0, 81.0]):
        scene = draw_kit.scene(target, rotvec_rad=(0, 0, angle), t_m=(0.02, 0.01, 5), quality="high")
        coverage = renderer.render(scene, target, labels=True).coverage.astype(float)
        a, b = scene.camera.project(scene.camera_from_target.apply([(0, -0.4, 0), (0, 0.4, 0)]))
        upright = abs(b[1] - a[1]) > abs(b[0] - a[0])
        image, (a, b) = (coverage, (a, b)) if upright else (coverage.T, (a[::-1], b[::-1]))
        lines = np.arange(int(min(a[1], b[1])) + 1, int(max(a[1], b[1])))
        edge = a[0] + (lines - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
        first = edge.astype(int) - 8
        window = image[lines[:, None], first[:, None] + np.arange(17)]
        shown = np.where(
            window[:, -1] > window[:, 0], first + 16.5 - window.sum(axis=1), first - 0.5 + window.sum(axis=1)
        )
        errors.append(shown - edge)
    errors = np.concatenate(errors)
    # drivers cut triangles so large, and round where they do: a sample of the 65 now and then
    assert np.sqrt(np.mean(errors**2)) < 0.01
    assert np.abs(errors).max() < 0.05


@pytest.mark.parametrize("quality", ["draft", "default"])
@pytest.mark.parametrize("reach_px", [5500, 6500, 8000])
def test_an_edge_that_reaches_beyond_both_sides_shows_its_area(renderer, draw_kit, quality, reach_px):
    # its ends are counted in whole steps yet, but products of them were once larger than whole numbers of 32 bits
    half_m = reach_px * 5 / draw_kit.camera.fx_px
    target = draw_kit.target([draw_kit.plate("p", "white", (half_m, 0, 0), half_m)], [draw_kit.white()])
    y, x = np.mgrid[0 : draw_kit.camera.height_px, 0 : draw_kit.camera.width_px]
    pixels = np.stack([x, y], axis=-1).astype(float)
    errors = []
    for angle in np.radians(np.arange(0, 180, 7.5)):
        scene = draw_kit.scene(target, rotvec_rad=(0, 0, angle), t_m=(0.02, 0.01, 5), quality=quality)
        coverage = renderer.render(scene, target, labels=True).coverage.astype(float)
        places = [(0, -0.2, 0), (0, 0.2, 0), (0.1, 0, 0)]
        a, b, inside = scene.camera.project(scene.camera_from_target.apply(places))
        along = (b - a) / np.linalg.norm(b - a)
        n = np.array([-along[1], along[0]])
        n *= np.sign(n @ (inside - a))
        d = (pixels - a) @ n
        at_edge = np.abs(d) < 0.75
        errors.append(coverage[at_edge] - _area_inside(n, d[at_edge]))
    # where the driver cuts the plate it rounds in its own way: about a sample along each edge
    assert max((np.abs(e) > 0.02).mean() for e in errors) < 0.03
