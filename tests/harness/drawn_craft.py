"""A Tango-like craft drawn with OpenCV: small pictures with a known pose for tests of the estimator."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat

CAMERA = CameraIntrinsics(960, 600, 1500.0, 1500.0, 479.5, 299.5)
NOISE_DN = 12.0

Face = tuple[np.ndarray, np.ndarray, float]


class Craft:
    """Body box, panel slab with a bright frame round dark cells, three rods: faces to draw and the board model."""

    def __init__(self) -> None:
        self.faces: list[Face] = []
        self.edges: list[dict[str, Any]] = []
        self.vertices: list[list[float]] = []
        self.triangles: list[list[int]] = []
        self.box("body", (-0.37, -0.264, 0.0), (0.37, 0.304, 0.30), (0.8, 0.8, 0.35, 0.4, 0.85, 0.4))
        self.box(
            "panel", (-0.37, -0.385, 0.2975), (0.37, 0.385, 0.3215), (0.35, 0.35, 0.35, 0.35, 0.25, 0.35)
        )
        for side in (-1, 1):
            near, far = sorted((side * 0.014, side * 0.35))
            cells = np.array([[near, -0.365], [far, -0.365], [far, 0.365], [near, 0.365]])
            self.faces.append((np.column_stack([cells, np.full(4, 0.322)]), np.array([0, 0, 1.0]), 0.04))
        for x in (-0.014, 0.014):
            self.edge("strip", (x, -0.365, 0.322), (x, 0.365, 0.322), [[0, 0, 1]])
        self.rod((-0.357, 0.379, 0.255), (-0.543, 0.488, 0.254))
        self.rod((0.357, 0.383, 0.256), (0.543, 0.488, 0.259))
        self.rod((0.306, -0.365, 0.250), (0.305, -0.579, 0.2515))

    def edge(self, name: str, a: Any, b: Any, normals: list[list[float]], radius: float = 0.0) -> None:
        ends = {"a_m": np.asarray(a).tolist(), "b_m": np.asarray(b).tolist()}
        self.edges.append({"name": name, **ends, "normals": normals, "radius_m": radius})

    def quads(self, v: np.ndarray, faces: list[list[int]]) -> None:
        base = len(self.vertices)
        self.vertices += v.tolist()
        for f in faces:
            self.triangles += [
                [base + f[0], base + f[1], base + f[2]],
                [base + f[0], base + f[2], base + f[3]],
            ]

    def box(self, name: str, low: Any, high: Any, albedo: tuple[float, ...]) -> None:
        v = np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )
        faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        normals = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], float)
        self.quads(v, faces)
        meets: dict[tuple[int, int], list[list[float]]] = {}
        for f, n, a in zip(faces, normals, albedo, strict=True):
            self.faces.append((v[f], n, a))
            for k in range(4):
                i, j = sorted((f[k], f[(k + 1) % 4]))
                meets.setdefault((i, j), []).append(n.tolist())
        for (i, j), n in meets.items():
            self.edge(name, v[i], v[j], n)

    def rod(self, a: Any, b: Any, radius: float = 0.028, sides: int = 12) -> None:
        a, b = np.array(a), np.array(b)
        axis = (b - a) / np.linalg.norm(b - a)
        e1 = np.cross(axis, [0, 0, 1.0])
        e1 /= np.linalg.norm(e1)
        e2 = np.cross(axis, e1)
        around = [np.cos(w) * e1 + np.sin(w) * e2 for w in np.arange(sides) * 2 * np.pi / sides]
        v = np.array([p + radius * d for p in (a, b) for d in around])
        quads = [[k, (k + 1) % sides, sides + (k + 1) % sides, sides + k] for k in range(sides)]
        self.quads(v, quads)
        for k, f in enumerate(quads):
            self.faces.append((v[f], around[k] + around[(k + 1) % sides], 0.4))
        self.edge("rod", a, b, [], radius)

    def model(self) -> BoardModel:
        half = float(np.sqrt(0.5))
        return BoardModel.from_dict(
            {
                "schema": "flyaround.board_model",
                "version": 1,
                "name": "craft",
                "sha256": "0",
                "wireframe": self.edges,
                "occluders": {"vertices_m": self.vertices, "triangles": self.triangles},
                "symmetry_wxyz": [[half, 0, 0, half], [0, 0, 0, 1], [half, 0, 0, -half]],
            }
        )

    def picture(
        self,
        q: np.ndarray,
        t: np.ndarray,
        to_sun: np.ndarray,
        rng: np.random.Generator,
        noise_dn: float = NOISE_DN,
    ) -> np.ndarray:
        """uint8 picture: z-buffered flat faces, Lambert, 1 px blur, additive noise."""
        R = quat.matrix(q)
        h, w = CAMERA.height_px, CAMERA.width_px
        image, depth = np.zeros((h, w), np.float32), np.full((h, w), np.inf)
        rays = (
            np.stack(np.meshgrid(np.arange(w) - CAMERA.cx_px, np.arange(h) - CAMERA.cy_px), -1) / CAMERA.fx_px
        )
        for corners, normal, albedo in self.faces:
            p = corners @ R.T + t
            n = R @ normal / np.linalg.norm(normal)
            if n @ p[0] >= 0:
                continue
            u = CAMERA.pixels(p)
            x0, y0 = np.maximum(np.floor(u.min(axis=0)).astype(int), 0)
            x1, y1 = np.minimum(np.ceil(u.max(axis=0)).astype(int) + 1, [w, h])
            if x1 <= x0 or y1 <= y0:
                continue
            mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
            cv2.fillConvexPoly(mask, np.rint((u - [x0, y0]) * 16).astype(np.int32), 1, cv2.LINE_8, 4)
            ray = rays[y0:y1, x0:x1]
            slope = ray[..., 0] * n[0] + ray[..., 1] * n[1] + n[2]
            z = (n @ p[0]) / np.where(np.abs(slope) < 1e-9, 1e-9, slope)
            near = (mask > 0) & (z < depth[y0:y1, x0:x1])
            depth[y0:y1, x0:x1][near] = z[near]
            image[y0:y1, x0:x1][near] = 330 * albedo * max(0.0, float(n @ to_sun)) + 2
        noisy = cv2.GaussianBlur(image, (0, 0), 1.0) + rng.normal(0, noise_dn, (h, w))
        return np.clip(noisy + 0.5, 0, 255).astype(np.uint8)


def sampled_pose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q = quat.normalise(rng.normal(size=4))
    z = rng.uniform(3.0, 8.0)
    t = np.array([rng.uniform(-0.12, 0.12), rng.uniform(-0.06, 0.06), 1.0]) * z
    phase, around = np.radians(rng.uniform(10, 60)), rng.uniform(0, 2 * np.pi)
    to_sun = np.array([np.sin(phase) * np.cos(around), np.sin(phase) * np.sin(around), -np.cos(phase)])
    return q, t, to_sun
