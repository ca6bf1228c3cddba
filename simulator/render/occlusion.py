"""How much of the sky each place on and around a spacecraft sees past the spacecraft: baked once, kept in the cache.

A grid of places holds the visibility over directions as a constant and a linear term, V(w) = a + b . w (a hemisphere is
exactly 1/2 + 3/4 n . w for what a cosine-weighted receiver gathers). It is counted from depth maps of the mesh seen
from many sides.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.cache import cached_array
from simulator.render.context import release
from simulator.render.mesh import VERTEX
from simulator.render.skylight import spiral

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import ByteArray, FloatArray
    from simulator.render.mesh import Mesh
    from simulator.render.programs import Program

VERSION = 3  # of what follows; part of the cache's key
FINE_GRID, COARSE_GRID = 64, 32  # places along each side of the box
SIMPLE_TRIANGLES = 2000  # fewer need the coarse grid only
DIRECTIONS = 64
MAP_PX = 192
LARGEST_SLOPE = 0.8  # of b, in the eight bits that hold it; a hemisphere has 0.75
_TURN_RAD = 0.38
_BIAS = 0.004  # of the box: a place on a face does not hide itself
_SOLID = 0.04  # of the sky: less is inside a body, and no place to stand


def occlusion_grid(mesh: Mesh) -> tuple[FloatArray, FloatArray, int]:
    """Lower corner and size [m] of the grid's box, the mesh and two steps around it, and its places on each side."""
    count = COARSE_GRID if mesh.indices.size < 12 * SIMPLE_TRIANGLES else FINE_GRID
    low, high = mesh.hull_m.min(axis=0), mesh.hull_m.max(axis=0)
    step = np.maximum((high - low) / (count - 5), 0.0075 * mesh.radius_m)
    return low - 2.5 * step, count * step, count


def baked_occlusion(
    context: moderngl.Context, program: Program, mesh: Mesh, shadow_array: moderngl.VertexArray
) -> ByteArray:
    """(N, N, N, 4) the grid, z first: b in the first three channels, a in the fourth; baked when the cache lacks it.

    Parameters
    ----------
    program : what draws depth by ``u_light_clip_from_target``. shadow_array : the mesh with it.
    """
    # by the geometry alone: materials come and go
    shape = np.frombuffer(mesh.vertices.read(), VERTEX)["position_m"].tobytes() + mesh.indices.read()
    key = f"occlusion-{VERSION}-{DIRECTIONS}-{hashlib.sha256(shape).hexdigest()[:24]}"
    return np.asarray(cached_array(key, lambda: _bake(context, program, mesh, shadow_array)), np.uint8)


def occlusion_texture(context: moderngl.Context, grid: ByteArray) -> moderngl.Texture3D:
    """The grid on the GPU."""
    count = grid.shape[0]
    texture = context.texture3d((count, count, count), 4, np.ascontiguousarray(grid))
    texture.filter = (context.LINEAR, context.LINEAR)
    texture.repeat_x = texture.repeat_y = texture.repeat_z = False
    return texture


def light_matrix(center_m: FloatArray, radius_m: float, along: FloatArray) -> FloatArray:
    """(4, 4) clip matrix of an orthographic box around a sphere, seen along a unit vector.

    The box is turned about the light: edges of a craft follow its axes, and one along a map's rows would lie half a
    texel off over all its length.
    """
    x = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    x = x / np.linalg.norm(x)
    x = np.cos(_TURN_RAD) * x + np.sin(_TURN_RAD) * np.cross(along, x)
    R = np.stack([x, np.cross(along, x), along]) / (radius_m * 1.02)
    matrix = np.eye(4)
    matrix[:3, :3] = R
    matrix[:3, 3] = -R @ center_m
    return matrix


def _bake(
    context: moderngl.Context, program: Program, mesh: Mesh, shadow_array: moderngl.VertexArray
) -> ByteArray:
    depth = context.depth_texture((MAP_PX, MAP_PX))
    framebuffer = context.framebuffer(depth_attachment=depth)
    low, size, count = occlusion_grid(mesh)
    steps = [low[k] + (np.arange(count) + 0.5) / count * size[k] for k in range(3)]
    z, y, x = np.meshgrid(steps[2], steps[1], steps[0], indexing="ij")
    places = np.stack([x.ravel(), y.ravel(), z.ravel()]).astype(np.float32)
    total = np.zeros((4, places.shape[1]), np.float32)
    for towards in spiral(DIRECTIONS):
        matrix = light_matrix(mesh.center_m, mesh.radius_m, -towards)
        program.set("u_light_clip_from_target", tuple(matrix.T.ravel().tolist()))
        framebuffer.use()
        framebuffer.clear()
        context.enable_only(context.DEPTH_TEST)
        shadow_array.render()
        seen = np.frombuffer(depth.read(alignment=1), np.float32).reshape(MAP_PX, MAP_PX)
        clip = matrix[:3, :3].astype(np.float32) @ places + matrix[:3, 3:].astype(np.float32)
        column, row = np.clip(((clip[:2] * 0.5 + 0.5) * MAP_PX).astype(int), 0, MAP_PX - 1)
        outside = np.abs(clip[:2]).max(axis=0) >= 1
        free = (outside | (clip[2] * 0.5 + 0.5 <= seen[row, column] + _BIAS)).astype(np.float32)
        total[3] += free
        total[:3] += 3 * free * towards[:, None].astype(np.float32)
    release(context, framebuffer, depth)
    shares = _outwards((total / DIRECTIONS).reshape(4, count, count, count))
    shares[:3] = shares[:3] / (2 * LARGEST_SLOPE) + 0.5
    return np.ascontiguousarray(np.clip(np.moveaxis(shares, 0, -1) * 255 + 0.5, 0, 255).astype(np.uint8))


def _outwards(shares: FloatArray) -> FloatArray:
    """Give places inside bodies what the nearest open places see, so that no darkness leaks out of a wall."""
    known = shares[3] > _SOLID
    for _ in range(3):
        weight, spread = np.zeros(known.shape, np.float32), np.zeros_like(shares)
        for axis in range(3):
            for shift in (-1, 1):
                near = np.roll(known, shift, axis=axis)
                weight += near
                spread += np.roll(shares * known, shift, axis=axis + 1)
        new = ~known & (weight > 0)
        shares[:, new] = spread[:, new] / weight[new]
        known = known | new
    return shares
