"""The tree that orders a craft's faces for the board: it ends, and hides rightly, for any mesh."""

import numpy as np
import trimesh

from flyaround.hil.board_model.bsp_tree import build_tree


def _far_to_near(tree, eye):
    """Faces in the order in which a board draws them."""
    order: list[int] = []
    todo: list[tuple[int, bool]] = [(0, False)]
    while todo:
        node, own = todo.pop()
        if own:
            order += tree.members[node]
            continue
        if node < 0:
            continue
        front, behind = tree.children[node]
        *n, d = tree.plane[node]
        near, far = (front, behind) if np.dot(n, eye) > d else (behind, front)
        todo += [(near, False), (node, True), (far, False)]
    return order


def test_warped_faces_and_fine_meshes_come_to_an_end():
    ball = trimesh.creation.icosphere(2, 1.0)
    corners = ball.triangles[:, [0, 1, 2, 2]].copy()
    # halves of neighbouring triangles as one face of four corners, up to a centimetre from flat
    corners[::2, 3] += 0.01 * ball.face_normals[::2]
    tree = build_tree(corners, np.ones(len(corners), bool))
    assert set(tree.source) == set(range(len(corners)))
    assert len(tree.source) < 4 * len(corners)


def test_the_last_face_drawn_on_a_ray_is_the_first_it_meets():
    rng = np.random.default_rng(1)
    boxes = [trimesh.creation.box((1, 1.3, 0.8)) for _ in range(4)]
    for k, box in enumerate(boxes):
        box.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        box.apply_translation((1.6 * k, 0.3 * k, 0))
    mesh = trimesh.util.concatenate(boxes)
    tree = build_tree(mesh.triangles[:, [0, 1, 2, 2]], np.ones(len(mesh.faces), bool))
    a, b, c = np.array(tree.corners_m)[:, :3].transpose(1, 0, 2)
    for eye in (np.array([9.0, 2, 3]), np.array([-6.0, -3, 1]), np.array([2.0, -8, 2])):
        place = np.argsort(_far_to_near(tree, eye))
        for point in mesh.triangles_center + 0.01:
            ray = point - eye
            # barycentric coordinates and distance of the ray in each triangle (Moeller and Trumbore 1997)
            h = np.cross(ray, c - a)
            det = np.sum((b - a) * h, axis=1)
            u = np.sum((eye - a) * h, axis=1) / det
            g = np.cross(eye - a, b - a)
            v, t = (g @ ray) / det, np.sum((c - a) * g, axis=1) / det
            hit = np.flatnonzero((u > 0.01) & (v > 0.01) & (u + v < 0.99))
            if len(hit) > 1 and np.diff(np.sort(t[hit])).min() > 1e-3:
                assert hit[np.argmax(place[hit])] == hit[np.argmin(t[hit])]
