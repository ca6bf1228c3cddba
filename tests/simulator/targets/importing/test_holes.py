"""Openings are capped where that gives a solid; coincident faces are reported."""

import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.add import ImportOptions, read_surface
from flyaround.simulator.targets.importing.repair.coincident_faces import coincident_pairs

KEEP = ImportOptions(keep_holes=True, up="z")
FILL = ImportOptions(fill_holes=True, up="z")
FILL_OR_KEEP = ImportOptions(fill_holes=True, keep_holes=True, up="z")


def surface(path, options):
    """The bodies of a mesh after its repairs, and what is said: all of an import but labels and mass."""
    _, bodies, _, _, _, lines = read_surface(path, options)
    return bodies, lines


def save(path, **parts):
    """A GLB of named parts."""
    scene = trimesh.Scene()
    for name, mesh in parts.items():
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    path.write_bytes(scene.export(file_type="glb"))
    return path


def raw(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False, validate=False)


def grid_plate(n, *, side_m=2.0, bar=0.2):
    """A flat sheet with n x n windows, without thickness: what a frame of cells is in many public models."""
    at = np.concatenate([[k, k + bar] for k in range(n + 1)]) * side_m / (n + bar)
    count = len(at)
    x, y = np.meshgrid(at, at, indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    faces = []
    for i in range(count - 1):
        for j in range(count - 1):
            if i % 2 == 1 and j % 2 == 1:
                continue  # a window
            a, b, c, d = i * count + j, (i + 1) * count + j, (i + 1) * count + j + 1, i * count + j + 1
            faces += [(a, b, c), (a, c, d)]
    return raw(vertices, faces)


def open_box(*, top=True):
    """A box of 1 m without its upper (or lower) face."""
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    return raw(box.vertices, box.faces[box.face_normals[:, 2] * (1 if top else -1) < 0.9])


def triangles(bodies, name):
    return sum(len(b.triangles) for b in bodies if b.name == name)


def test_windows_of_a_frame_are_not_capped(tmp_path):
    """35 x 35 windows: 1,225 rings and the rim, none of which leaves a solid."""
    frame = grid_plate(35)
    path = save(tmp_path / "a.glb", frame=frame, hull=open_box())
    start = time.process_time()
    with pytest.raises(UserError, match=r"part 'frame': .*--keep-holes too: caps would not make a solid"):
        surface(path, replace(FILL, strict=True))
    bodies, lines = surface(path, FILL_OR_KEEP)
    assert "filled 1 hole with flat fans" in lines
    assert any(line.startswith("left 1,226 holes open") for line in lines)
    assert triangles(bodies, "frame") == len(frame.faces)
    assert triangles(bodies, "hull") == 10 + 4
    assert time.process_time() - start < 60  # 2 s where this was written


def test_an_opening_with_glass_in_it_stays_open(tmp_path):
    """Glass in the plane of the opening, and 5 mm behind it; 30 cm behind it is no glass of this opening."""
    for depth_m, capped in ((0.0, False), (0.005, False), (0.3, True)):
        glass = raw([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], [[0, 1, 2], [0, 2, 3]])
        glass.apply_translation((0, 0, 0.5 - depth_m))
        path = save(tmp_path / "a.glb", hull=open_box(), glass=glass)
        bodies, lines = surface(path, FILL_OR_KEEP)
        assert triangles(bodies, "hull") == (14 if capped else 10), lines
        assert not any("lie in one plane" in line for line in lines)


def test_a_box_open_below_is_capped_where_it_stands_on_a_plate(tmp_path):
    """Solids that touch look at each other: neither face is seen, and nothing flickers."""
    plate = trimesh.creation.box((3.0, 3.0, 0.2))
    plate.apply_translation((0, 0, -0.6))
    path = save(tmp_path / "a.glb", hull=open_box(top=False), plate=plate)
    bodies, lines = surface(path, FILL)
    assert triangles(bodies, "hull") == 14
    assert not any("lie in one plane" in line for line in lines)


def test_nested_openings_are_not_capped(tmp_path):
    """An open tray with a shaft through it: at the back the rim's cap would lie on the shaft's."""
    front = grid_plate(1)
    low, high = front.vertices.min(axis=0), front.vertices.max(axis=0)
    edges = trimesh.grouping.group_rows(front.edges_sorted, require_count=1)
    walls, vertices = [], np.concatenate([front.vertices, front.vertices - (0, 0, 0.3)])
    n = len(front.vertices)
    for a, b in front.edges[edges]:
        walls += [(a, a + n, b), (b, a + n, b + n)]
    tray = raw(vertices, np.concatenate([front.faces, walls]))
    assert np.allclose(high - low, (2, 2, 0))
    path = save(tmp_path / "a.glb", tray=tray)
    with pytest.raises(UserError, match=r"2 holes .*--keep-holes too"):
        surface(path, replace(FILL, strict=True))


def test_caps_beyond_the_wanted_number_of_triangles_are_said(tmp_path):
    fine = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide()
    opened = raw(fine.vertices, fine.faces[fine.face_normals[:, 2] < 0.9])
    assert len(opened.faces) == 640
    path = save(tmp_path / "box.glb", box=opened)
    bodies, lines = surface(path, replace(FILL, decimate=640))
    n = sum(len(b.triangles) for b in bodies)
    assert n > 640
    said = f"the caps of its holes make {n} triangles, more than 640"
    assert f"{said} (--decimate {1280 - n} leaves room for them)" in lines
    bodies, lines = surface(path, replace(FILL, decimate=1280 - n))
    assert sum(len(b.triangles) for b in bodies) <= 640
    assert not any("the caps" in line for line in lines)


def test_advice_names_keeping_before_filling(tmp_path):
    path = save(tmp_path / "a.glb", hull=open_box())
    with pytest.raises(
        UserError, match=r"add --keep-holes .* or --fill-holes to cap the holes where that gives a solid"
    ):
        surface(path, ImportOptions(up="z", strict=True))


def decal(gap_m, *, up=True, side_m=0.4):
    sheet = raw(
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * side_m / 2, [[0, 1, 2], [0, 2, 3]]
    )
    if not up:
        sheet.invert()
    sheet.apply_translation((0.1, 0.2, 0.5 + gap_m))
    return sheet


@pytest.mark.parametrize(
    ("gap_m", "up", "said"), [(0.0, True, True), (0.0, False, True), (2e-6, True, True), (1e-3, True, False)]
)
def test_coincident_sheet_is_reported(tmp_path, gap_m, up, said):
    path = save(tmp_path / "a.glb", hull=trimesh.creation.box((1, 1, 1)), label=decal(gap_m, up=up))
    _, lines = surface(path, KEEP)
    found = [line for line in lines if "lie in one plane and overlap" in line]
    assert len(found) == said
    if said:
        assert "parts 'hull' and 'label'" in found[0]
        assert "0.500) m" in found[0]


def test_overlapping_bodies_are_reported_but_not_touching_ones(tmp_path):
    hull, small = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.2, 0.2, 0.2))
    for z, said in ((0.4, True), (0.6, False)):
        inset = small.copy()
        inset.apply_translation((0, 0, z))
        _, lines = surface(save(tmp_path / "a.glb", hull=hull, inset=inset), ImportOptions(up="z"))
        assert any("lie in one plane and overlap" in line for line in lines) == said


def test_coincident_pairs_are_those_that_share_an_area():
    """Random triangles in a few planes, against OpenCV's intersection of convex polygons."""
    rng = np.random.default_rng(4)
    flat = rng.uniform(-1, 1, (120, 3, 2)) * 0.4 + rng.uniform(-1, 1, (120, 1, 2))
    plane = rng.integers(0, 3, 120)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    corners = (
        np.concatenate([flat, np.broadcast_to((plane * 0.5)[:, None, None], (120, 3, 1))], axis=2) @ turn.T
    )
    found = {tuple(p) for p in coincident_pairs(corners, 3.0).tolist()}
    shared = {
        (i, j): cv2.intersectConvexConvex(flat[i].astype(np.float32), flat[j].astype(np.float32))[0]
        for i in range(120)
        for j in range(i + 1, 120)
        if plane[i] == plane[j]
    }
    assert {pair for pair, area in shared.items() if area > 1e-4} <= found
    assert found <= {pair for pair, area in shared.items() if area > 0}
    assert len(found) > 100
