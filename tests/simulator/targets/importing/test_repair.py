"""Repairs of imported meshes are correct and reported; unsafe repairs are refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.decimation import decimate
from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.geometry.triangles import distance_to_triangles
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.importing.add import ImportOptions, import_mesh, read_surface
from flyaround.simulator.targets.library import load_target

pytestmark = pytest.mark.usefixtures("coarse_proposals")

SHEETS = ImportOptions(keep_holes=True)


def soup(mesh):
    """STL bytes of faces as they are."""
    return mesh.export(file_type="stl")


def save(path, mesh):
    path.write_bytes(soup(mesh))
    return path


def raw_mesh(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False, validate=False)


def surface(path, options=None):
    """A mesh read and repaired, with its lines for the user; no labels are proposed, which takes most of an import."""
    *_, parts, lines = read_surface(path, options or ImportOptions())
    return SimpleNamespace(parts=parts), lines


def volume(target):
    total = 0.0
    for p in target.parts:
        c = p.positions_m.astype(float)[p.triangles]
        total += np.einsum("ij,ij->", c[:, 0], np.cross(c[:, 1], c[:, 2])) / 6
    return total


def surface_distance(target, points):
    """(K,) distance of points to the target's surface [m]."""
    corners = np.concatenate([p.positions_m.astype(float)[p.triangles] for p in target.parts])
    return np.array([distance_to_triangles(np.tile(q, (len(corners), 1)), corners).min() for q in points])


BOX = trimesh.creation.box((2.0, 1.0, 0.5))


def test_clean_box_is_imported_unchanged(tmp_path):
    target, lines, _ = import_mesh(save(tmp_path / "box.stl", BOX), "box")
    assert volume(target) == pytest.approx(1.0)
    assert "merged 28 duplicate vertices" in lines
    assert not any("turned" in line for line in lines)
    corners = {tuple(np.round(k.position_m, 6)) for k in target.keypoints}
    assert corners == {tuple(v) for v in BOX.vertices}
    assert len(target.wireframe) == 12
    for e in target.wireframe:
        a, b = np.array(e.a_m), np.array(e.b_m)
        assert np.sort(np.abs(b - a))[:2] == pytest.approx((0, 0))
        for n in e.normals:
            # an outward face normal of the box: along one axis, away from the middle
            assert np.dot(n, (a + b) / 2) > 0.2
            assert np.abs(n).max() == pytest.approx(1.0)
    assert len(target.occluders.triangles) == 12
    assert target.mass.mass_kg == pytest.approx(250.0)
    # a uniform cuboid
    assert np.diag(target.mass.inertia_kg_m2) == pytest.approx(
        250 / 12 * np.array([1.25, 4.25, 5.0]), rel=1e-6
    )


@pytest.mark.parametrize("turned", [[0], [3, 4, 5, 9], list(range(12))])
def test_faces_that_look_inwards_are_turned(tmp_path, turned):
    faces = BOX.faces.copy()
    faces[turned] = faces[turned][:, ::-1]
    target, lines = surface(save(tmp_path / "a.stl", raw_mesh(BOX.vertices, faces)))
    assert volume(target) == pytest.approx(1.0)
    assert f"turned {len(turned)} face{'s' * (len(turned) > 1)} to look outwards (part 'body')" in lines


def test_a_cavity_and_a_body_apart_are_each_turned(tmp_path):
    other = BOX.copy()
    other.apply_translation((5, 0, 0))
    faces = np.concatenate([BOX.faces, other.faces[:, ::-1] + 8])
    mesh = raw_mesh(np.concatenate([BOX.vertices, other.vertices]), faces)
    target, lines = surface(save(tmp_path / "a.stl", mesh))
    assert volume(target) == pytest.approx(2.0)
    assert any("turned 12 faces" in line for line in lines)


def facing(part):
    """(F, 3) vectors along the faces' normals, by their winding."""
    a, b, c = np.moveaxis(part.positions_m.astype(float)[part.triangles], 1, 0)
    return np.cross(b - a, c - a)


def test_an_almost_closed_ball_that_is_inside_out_is_turned(tmp_path):
    ball = trimesh.creation.icosphere(3, 1.0)
    mesh, lines = surface(save(tmp_path / "a.stl", raw_mesh(ball.vertices, ball.faces[1:, ::-1])))
    (part,) = mesh.parts
    outward = part.positions_m[part.triangles].mean(axis=1)
    assert (np.einsum("ij,ij->i", facing(part), outward) > 0).all()
    assert any(line.startswith("turned 1,279 faces to look outwards") for line in lines)


def test_an_open_sheet_looks_where_the_normals_of_the_file_do(tmp_path):
    corners = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n"
    for z in (1, -1):
        path = tmp_path / f"sheet{z}.obj"
        path.write_text(f"{corners}vn 0 0 {z}\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n")
        (part,) = surface(path, ImportOptions(up="z", units="m"))[0].parts
        assert (facing(part) @ (0, 0, z) > 0).all()
        assert (part.normals @ (0, 0, z) > 0.99).all()


def test_inverted_normals_of_a_file_are_replaced(tmp_path):
    mesh = BOX.copy()
    glb = trimesh.Trimesh(
        mesh.vertices[mesh.faces.ravel()],
        np.arange(36).reshape(-1, 3),
        vertex_normals=-np.repeat(mesh.face_normals, 3, axis=0),
        process=False,
    )
    path = tmp_path / "a.glb"
    path.write_bytes(glb.export(file_type="glb", include_normals=True))
    target, lines = surface(path)
    assert volume(target) == pytest.approx(1.0)
    assert any(line.startswith("computed normals anew of 1 part that pointed inwards") for line in lines)
    p = target.parts[0]
    assert (np.einsum("ij,ij->i", p.normals, p.positions_m) > 0.2).all()


def test_faces_without_area_and_copies_are_dropped(tmp_path):
    faces = np.concatenate(
        [BOX.faces, [[0, 0, 1], [2, 5, 2]], BOX.faces[:3], np.roll(BOX.faces[3:4], 1, axis=1)]
    )
    path = tmp_path / "a.obj"
    path.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices)
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    )
    target, lines = surface(path)
    assert "dropped 2 faces without area" in lines
    assert "dropped 4 duplicate faces" in lines
    assert sum(len(p.triangles) for p in target.parts) == 12


def test_a_sheet_keeps_its_back_and_a_face_that_float32_cannot_turn_goes(tmp_path):
    corners = [[0, 0, 0], [10, 0, 0], [0, 10, 0], [5, 3e-7, 0]]
    faces = [[0, 1, 2], [0, 2, 1], [1, 2, 0], [0, 1, 3]]
    mesh, lines = surface(save(tmp_path / "a.stl", raw_mesh(corners, faces)))
    (part,) = mesh.parts
    assert "dropped 1 duplicate face" in lines
    assert "dropped 1 face without area" in lines
    assert sorted(np.sign(facing(part)[:, 2])) == [-1, 1]


def test_creases_stay_sharp_and_round_shapes_smooth(tmp_path):
    cylinder = trimesh.creation.cylinder(1.0, 2.0, sections=48)
    target, *_ = import_mesh(save(tmp_path / "a.stl", cylinder), "a")
    p = target.parts[0]
    side = np.abs(p.normals[:, 2]) < 0.5
    radial = p.positions_m[side, :2] / np.linalg.norm(p.positions_m[side, :2], axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", p.normals[side, :2], radial).min() > 0.9999
    assert np.abs(p.normals[~side, 2]).min() > 0.9999
    # the rims, as straight stretches on them, and nothing along the smooth side
    assert 16 <= len(target.wireframe) <= 100
    for e in target.wireframe:
        assert abs(e.a_m[2]) == pytest.approx(1.0)
        assert e.a_m[2] == pytest.approx(e.b_m[2])
        assert sorted(abs(n[2]) for n in e.normals) == pytest.approx([0, 1], abs=1e-6)
        middle = (np.array(e.a_m) + e.b_m) / 2
        assert np.hypot(*middle[:2]) > 0.99


def test_holes_are_refused_filled_or_kept(tmp_path):
    path = save(tmp_path / "a.stl", raw_mesh(BOX.vertices, BOX.faces[BOX.face_normals[:, 2] < 0.9]))
    with pytest.raises(
        UserError, match=r"a\.stl, part 'body': 1 hole with 4 open edges \(the first at .*--fill-holes"
    ):
        surface(path, ImportOptions(strict=True))
    target, lines = surface(path, ImportOptions(fill_holes=True))
    assert "filled 1 hole with flat fans" in lines
    assert volume(target) == pytest.approx(1.0)
    kept, lines = surface(path, SHEETS)
    assert any(line.startswith("kept 1 open outlines (4 open edges)") for line in lines)
    assert sum(len(p.triangles) for p in kept.parts) == 10
    # an almost whole box still knows its outside
    p = kept.parts[0]
    assert (np.einsum("ij,ij->i", p.normals, p.positions_m) > 0).all()


def test_holes_that_meet_in_a_corner_are_not_filled_and_said_so(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=1)
    first = ball.faces[0]
    # two faces that share one corner and no edge
    other = next(k for k, f in enumerate(ball.faces) if len(set(f) & set(first)) == 1)
    kept = [k for k in range(len(ball.faces)) if k not in (0, other)]
    path = save(tmp_path / "ball.stl", raw_mesh(ball.vertices, ball.faces[kept]))
    with pytest.raises(UserError, match="add --keep-holes too: caps would not make a solid"):
        import_mesh(path, "ball", ImportOptions(fill_holes=True, strict=True))
    target, lines, _ = import_mesh(path, "ball", ImportOptions(fill_holes=True, keep_holes=True))
    assert any("open outlines" in line for line in lines)
    assert target.mass.mass_kg > 0


def test_edges_of_three_faces_are_refused_or_kept(tmp_path):
    fin = np.array([[0, 3, 0.0]])
    shared = BOX.faces[0, :2]
    mesh = raw_mesh(np.concatenate([BOX.vertices, fin]), np.concatenate([BOX.faces, [[*shared, 8]]]))
    path = save(tmp_path / "a.stl", mesh)
    with pytest.raises(
        UserError, match=r"part 'body': 1 edge belongs to three or more faces .*--keep-non-manifold"
    ):
        surface(path, replace(SHEETS, strict=True))
    _, lines = surface(path, replace(SHEETS, keep_non_manifold=True))
    assert "kept 1 edges of three or more faces" in lines


def test_bodies_that_share_an_edge_are_no_fault(tmp_path):
    other = BOX.copy()
    other.apply_translation((2.0, 1.0, 0))
    target, *_ = import_mesh(save(tmp_path / "a.stl", trimesh.util.concatenate([BOX, other])), "a")
    assert volume(target) == pytest.approx(2.0)
    assert len(target.wireframe) == 23


def test_a_one_sided_surface_is_refused(tmp_path):
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rim = [
        [
            ((1 + s * np.cos(t / 2)) * np.cos(t), (1 + s * np.cos(t / 2)) * np.sin(t), s * np.sin(t / 2))
            for s in (-0.3, 0.3)
        ]
        for t in turn
    ]
    vertices = np.array(rim).reshape(-1, 3)
    faces = []
    for k in range(24):
        a, b = 2 * k, 2 * k + 1
        c, d = (2 * k + 2, 2 * k + 3) if k < 23 else (1, 0)
        faces += [(a, c, b), (b, c, d)]
    path = save(tmp_path / "a.stl", raw_mesh(vertices, faces))
    with pytest.raises(UserError, match="48 faces form a one-sided surface"):
        surface(path, replace(SHEETS, strict=True))
    _, lines = surface(path)
    assert any(line.startswith("kept 48 faces of one-sided surfaces") for line in lines)


def test_mass_and_density(tmp_path):
    path = save(tmp_path / "a.stl", BOX)
    heavy, *_ = import_mesh(path, "a", ImportOptions(mass_kg=8.0))
    assert heavy.mass.mass_kg == 8.0
    assert np.diag(heavy.mass.inertia_kg_m2) == pytest.approx(8 / 12 * np.array([1.25, 4.25, 5.0]), rel=1e-6)
    dense, *_ = import_mesh(path, "a", ImportOptions(density_kg_m3=1000.0))
    assert dense.mass.mass_kg == pytest.approx(1000.0)
    with pytest.raises(UserError, match="--mass -1 is not a positive number"):
        import_mesh(path, "a", ImportOptions(mass_kg=-1.0))


def test_a_flat_sheet_has_mass_of_its_surface(tmp_path):
    path = save(
        tmp_path / "a.stl", raw_mesh([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    )
    target, lines, _ = import_mesh(path, "a", SHEETS)
    assert target.mass.mass_kg == pytest.approx(20.0)
    assert target.mass.com_m == pytest.approx((1, 0.5, 0))
    assert any("a shell of 2 m2" in line for line in lines)
    assert len(target.wireframe) == 4
    assert all(len(e.normals) == 2 for e in target.wireframe)


@pytest.fixture(scope="module")
def tango_in_mm(tmp_path_factory):
    """Tango's own mesh in millimetres, as some other tool would export it."""
    tango = load_target("tango")
    scene = trimesh.Scene()
    for p in tango.parts:
        mesh = trimesh.Trimesh(p.positions_m * 1000, p.triangles, vertex_normals=p.normals, process=False)
        scene.add_geometry(mesh, node_name=p.name, geom_name=p.name)
    path = tmp_path_factory.mktemp("tango") / "tango_mm.glb"
    path.write_bytes(scene.export(file_type="glb"))
    return tango, path


def test_tango_in_millimetres_needs_the_units_option(tango_in_mm, tmp_path):
    tango, path = tango_in_mm
    with pytest.raises(
        UserError, match=r"1110 m across.* add --units mm if it is in millimetres \(1\.11 m\)"
    ):
        import_mesh(path, "mine")
    target, lines, _ = import_mesh(path, "mine", ImportOptions(units="mm", up="z"))
    low, high = (f([f(p.positions_m, axis=0) for p in tango.parts], axis=0) for f in (np.min, np.max))
    points = np.concatenate([p.positions_m for p in target.parts])
    assert np.abs(points.min(axis=0) - low).max() < 1e-5
    assert np.abs(points.max(axis=0) - high).max() < 1e-5
    assert [p.name for p in target.parts] == [p.name for p in tango.parts]
    assert not any("turned" in line or "kept" in line for line in lines)
    assert len(target.keypoints) == 16
    assert surface_distance(target, [k.position_m for k in target.keypoints]).max() < 1e-6
    # both ends of every edge, and its middle, are on the mesh
    for e in target.wireframe[:60:3]:
        ends = np.array([e.a_m, e.b_m])
        assert surface_distance(target, [*ends, ends.mean(axis=0)]).max() < 6e-3 + e.radius_m
    # much of what the craft's own table of keypoints calls corners and tips is found again
    proposed = np.array([k.position_m for k in target.keypoints])
    own = np.array([k.position_m for k in tango.keypoints[:11]])
    near = np.linalg.norm(own[:, None] - proposed, axis=2).min(axis=1)
    assert (near < 0.06).sum() >= 6
    write_glb(target, tmp_path / "mine.glb")
    assert load_glb(tmp_path / "mine.glb").sha256 == target.sha256


def test_the_same_mesh_gives_the_same_target(tmp_path):
    ball = trimesh.creation.icosphere(4, 1.0)
    path = save(tmp_path / "a.stl", trimesh.util.concatenate([ball, BOX.copy().apply_translation((3, 0, 0))]))
    options = ImportOptions(decimate=2000)
    assert import_mesh(path, "a", options)[0].sha256 == import_mesh(path, "a", options)[0].sha256


def test_a_target_file_is_taken_whole(tmp_path):
    tango = load_target("tango")
    write_glb(tango, tmp_path / "mine.glb")
    target, lines, _ = import_mesh(tmp_path / "mine.glb", "mine")
    assert (target.name, target.sha256, target.keypoints) == ("mine", tango.sha256, tango.keypoints)
    assert lines == ["already a target file: geometry, keypoints, wireframe and mass taken as they are"]


def test_decimation_measures_what_it_did(tmp_path):
    path = save(tmp_path / "a.stl", trimesh.creation.icosphere(5, 1.0))
    target, lines = surface(path, ImportOptions(decimate=3000))
    count = sum(len(p.triangles) for p in target.parts)
    assert 2000 < count <= 3000
    (line,) = [x for x in lines if x.startswith("reduced 20,480 triangles to")]
    rms_mm, largest_mm = (float(x.split(" mm")[0].split()[-1]) for x in line.split(":")[1].split(","))
    # chords of 3000 triangles on a unit sphere lie about 1.5 mm under it
    assert 0 < rms_mm < 5
    assert rms_mm <= largest_mm < 40
    radius = np.linalg.norm(target.parts[0].positions_m, axis=1)
    assert np.abs(radius - 1).max() < 0.04
    assert volume(target) == pytest.approx(4 / 3 * np.pi, rel=0.01)


def test_a_mesh_that_no_grid_reduces_far_enough_is_refused(tmp_path):
    """Large triangles at random: even clusters of half the mesh keep more than 500."""
    corners = np.random.default_rng(0).uniform(-1.0, 1.0, (20_000, 3))
    path = save(tmp_path / "soup.stl", raw_mesh(corners, np.arange(18_000).reshape(-1, 3)))
    options = ImportOptions(decimate=500, keep_holes=True, keep_non_manifold=True)
    with pytest.raises(UserError, match=r"cannot be reduced below [\d,]+ triangles: use --decimate"):
        surface(path, options)


def test_thin_plates_are_reduced_to_the_number_that_is_asked_for():
    fine = trimesh.creation.box((1.0, 0.004, 1.0)).subdivide().subdivide().subdivide()
    stack = trimesh.util.concatenate([fine.copy().apply_translation((0, 0.05 * k, 0)) for k in range(4)])
    body = MeshBody(
        name="stack",
        positions_m=np.asarray(stack.vertices),
        triangles=np.asarray(stack.faces),
        face_material=np.zeros(len(stack.faces), int),
    )
    for most in (768, 160):
        reduced = decimate([body], most)
        assert 0.5 * most < sum(len(b.triangles) for b in reduced) <= most


@pytest.mark.slow
def test_five_million_triangles_are_refused_at_once_and_reduced_within_a_minute(tmp_path):
    import time

    n = 1600
    polar, around = np.meshgrid(np.linspace(0, np.pi, n), np.arange(n) * 2 * np.pi / n, indexing="ij")
    points = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n), indexing="ij")
    a, b = (i * n + j).ravel(), (i * n + (j + 1) % n).ravel()
    faces = np.concatenate([np.stack([a, a + n, b + n], axis=1), np.stack([a, b + n, b], axis=1)])
    record = np.zeros(
        len(faces), np.dtype([("n", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    )
    record["corners"] = points[faces]
    path = tmp_path / "big.stl"
    path.write_bytes(bytes(80) + len(faces).to_bytes(4, "little") + record.tobytes())
    start = time.process_time()
    with pytest.raises(UserError, match=r"5,116,800 triangles and at most 500,000"):
        import_mesh(path, "big")
    assert time.process_time() - start < 15
    start = time.process_time()
    target, *_ = import_mesh(path, "big", ImportOptions(decimate=100_000))
    assert time.process_time() - start < 60
    assert sum(len(p.triangles) for p in target.parts) <= 100_000
