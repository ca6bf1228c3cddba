"""Radiance transfer between the parts of a craft, baked on the nodes of its charts: sky visibility, interreflection.

Each node stores the sky's visibility as a constant and a linear term over directions, V(w) = a + b . w; and the
irradiance from other parts lit by the Sun from many directions, with shadows and multiple bounces. Parts reflect
diffusely (radiosity): Goral et al. (1984), Modeling the interaction of light between diffuse surfaces, SIGGRAPH 18.
Light of the sky is summed over the same directions and stored as spherical harmonics: Sloan, Kautz & Snyder (2002),
Precomputed radiance transfer, SIGGRAPH 29.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.sparse import coo_matrix

from flyaround.simulator.baking.baked_mesh import VERTEX
from flyaround.simulator.baking.baked_visibility import (
    decode_visibility,
    encode_visibility,
    trace_visibility,
)
from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.geometry.ray_cast import make_ray_caster
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_arrays
from flyaround.simulator.runtime.prebuilt import prebuilt_array

if TYPE_CHECKING:
    from flyaround.simulator.baking.baked_mesh import BakedMesh
    from flyaround.simulator.baking.baked_visibility import NodeVisibility
    from flyaround.simulator.baking.charts import Charts
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray

_T = TypeVar("_T", bound=np.generic)
DIRECTIONS = 128  # directions of rays, and of the Sun
LARGEST_SLOPE = 0.8  # full scale of b, which is stored in eight bits; an open hemisphere has 0.75
BOUNCES = 4  # reflections between parts
INTERREFLECTION_STEP = 2.0**-16  # irradiance from other parts never exceeds the sunlight, so 16 bits hold it
PATCH = 4  # nodes along each side of a patch with one radiosity
_BLOCK = 1 << 17  # multiplications per block
_INSIDE_SHARE = 0.3  # share of back faces in view above which a node is inside another part


@dataclass(frozen=True, eq=False)
class RadianceTransfer:
    """Baked light of one craft in some bands.

    Parameters
    ----------
    visibility : (A, 4) array
        Coefficients b (scaled by ``LARGEST_SLOPE``) and a for each texel of the atlas, row by row.
    interreflected : (n, D, A) array
        Irradiance from other parts, for sunlight from each of ``directions``, over the Sun's; in steps of
        ``INTERREFLECTION_STEP``.
    interreflected_sky : (n, 9, A) array
        The same per coefficient of the sky's radiance in `harmonics`.
    directions : (D, 3) array
        Unit vectors to the Sun for which ``interreflected`` was computed, model frame.
    """

    visibility: ByteArray
    interreflected: np.typing.NDArray[np.uint16]
    interreflected_sky: Float32Array
    directions: FloatArray


def harmonics(directions: FloatArray) -> FloatArray:
    """Return real spherical harmonics to the second degree; Ramamoorthi & Hanrahan (2001), eq. 3.

    Returns
    -------
    (..., 9) array
        Values of the orthonormal harmonics in the directions (..., 3): degree 0, then y, z and x of degree 1, then
        xy, yz, xz, 3 z^2 - 1 and x^2 - y^2 of degree 2.
    """
    x, y, z = np.moveaxis(np.asarray(directions, float), -1, 0)
    ones = np.ones_like(x)
    return np.stack(
        [
            0.282095 * ones,
            *(0.488603 * v for v in (y, z, x)),
            *(1.092548 * v for v in (x * y, y * z, x * z)),
            0.315392 * (3 * z * z - 1),
            0.546274 * (x * x - y * y),
        ],
        axis=-1,
    )


def baked_transfer(mesh: BakedMesh, reflectance: FloatArray, patch: int = PATCH) -> RadianceTransfer:
    """Return the radiance transfer of a mesh, cached; rays are cast once per geometry.

    Parameters
    ----------
    mesh : BakedMesh
        Mesh with its charts.
    reflectance : (M, n) array
        Of each material, per band.
    patch : int, optional
        Nodes along each side of a patch.

    Returns
    -------
    RadianceTransfer
        Visibility of the sky and interreflected light of each node, in the order of the mesh's charts.
    """
    charts = mesh.charts
    visibility_key = _visibility_entry(mesh, patch)
    key = entry_name("transfer", (solve_radiosity,), visibility_key, np.round(reflectance, 6))
    materials = np.rint(_vertices(mesh)["material"][charts.triangles[charts.triangle, 0]]).astype(int) - 1

    def bake() -> tuple[np.typing.NDArray[np.generic], np.typing.NDArray[np.generic]]:
        rays = _prebuilt_visibility(visibility_key, mesh, patch) or _traced_visibility(mesh)
        return solve_radiosity(charts, rays, reflectance[materials], patch, closed=mesh.is_closed)

    visibility, interreflected = (np.asarray(array) for array in cached_arrays((f"{key}-sky", key), bake))
    directions = spherical_fibonacci(DIRECTIONS)
    basis = (harmonics(directions) * (INTERREFLECTION_STEP * 4 * np.pi / DIRECTIONS)).astype(np.float32)
    sky = np.stack([product_in_blocks(basis.T, band.astype(np.float32)) for band in interreflected])
    return RadianceTransfer(visibility, interreflected, sky, directions)


def visibility_to_ship(
    mesh: BakedMesh, patch: int = PATCH
) -> tuple[str, np.typing.NDArray[np.unsignedinteger]]:
    """Return the visibility of a mesh, the slowest part of baking, which does not depend on materials.

    Returns
    -------
    entry : str
        Name of the cache entry.
    codes : array
        Code of each node and direction, of 16 bits where they suffice.
    """
    codes = encode_visibility(_traced_visibility(mesh), _patches(mesh.charts, patch)[0])
    small = codes.max() <= np.iinfo(np.uint16).max
    return _visibility_entry(mesh, patch), codes.astype(np.uint16) if small else codes


def _prebuilt_visibility(key: str, mesh: BakedMesh, patch: int) -> NodeVisibility | None:
    codes = prebuilt_array(key)
    if codes is None:
        return None
    numbers = _patches(mesh.charts, patch)[0]
    return decode_visibility(
        np.asarray(codes, codes.dtype),
        numbers,
        mesh.charts,
        mesh.planes[:, :3],
        spherical_fibonacci(DIRECTIONS),
    )


def _traced_visibility(mesh: BakedMesh) -> NodeVisibility:
    caster = make_ray_caster(_vertices(mesh)["position_m"][mesh.triangles])
    return trace_visibility(
        mesh.charts, mesh.planes[:, :3], caster, spherical_fibonacci(DIRECTIONS), mesh.radius_m
    )


def _vertices(mesh: BakedMesh) -> np.typing.NDArray[np.void]:
    return mesh.values.view(VERTEX).ravel()


def _visibility_entry(mesh: BakedMesh, patch: int) -> str:
    vertices = _vertices(mesh).tobytes()
    makers = (visibility_to_ship, trace_visibility, make_ray_caster, spherical_fibonacci)
    return entry_name("visibility", makers, DIRECTIONS, patch, vertices, mesh.triangles, mesh.charts.uv)


def product_in_blocks(a: Float32Array, b: Float32Array) -> Float32Array:
    """Return the (M, N) product of (M, K) and (K, N), identical for every number of BLAS threads.

    BLAS divides the columns among its threads, and rounding depends on this division. Blocks small enough for a single
    thread avoid that.
    """
    out = np.empty((len(a), b.shape[1]), np.float32)
    columns = max(_BLOCK // a.size, 1)
    for first in range(0, b.shape[1], columns):
        block = slice(first, first + columns)
        np.matmul(a, b[:, block], out=out[:, block])
    return out


def solve_radiosity(
    charts: Charts, rays: NodeVisibility, reflectance: FloatArray, side: int = PATCH, *, closed: bool
) -> tuple[ByteArray, np.typing.NDArray[np.uint16]]:
    """Solve the radiosity of patches: visibility and interreflected light of `RadianceTransfer`.

    Parameters
    ----------
    charts : Charts
        Charts of the mesh, with their nodes.
    rays : NodeVisibility
        Visibility of the nodes.
    reflectance : (N, n) array
        Of each node, per band.
    side : int, optional
        Side of a patch [nodes].
    closed : bool
        True if a ray that hits the back of a face starts inside a part.
    """
    n = len(charts.chart)
    in_view = rays.cosines[rays.node, rays.direction]
    back_share = np.bincount(rays.node, weights=in_view * (rays.hit_back & closed), minlength=n)
    total = np.maximum(rays.cosines.sum(axis=1), 1e-9)
    is_valid = back_share < _INSIDE_SHARE * total
    visibility = _visibility(charts, rays, is_valid)
    # transfer from patches to nodes
    patch, count = _patches(charts, side)
    # only front faces are lit; the back of an open shell occludes but does not reflect
    front = np.flatnonzero(~rays.hit_back)
    node = rays.node[front]
    share = (in_view[front] / np.maximum(total - back_share, 1e-9)[node]).astype(np.float32)
    transfer = coo_matrix((share, (node, patch[rays.hit_node[front]])), shape=(len(patch), count)).tocsr()
    size = np.bincount(patch, weights=is_valid, minlength=count)
    mean = coo_matrix(
        (is_valid / np.maximum(size, 1)[patch], (patch, np.arange(len(patch)))), shape=(count, len(patch))
    ).tocsr()
    between = mean @ transfer
    direct = mean @ (rays.cosines * rays.is_open)
    bands = []
    for band in reflectance.T:
        paint = (mean @ band)[:, None].astype(np.float32)
        leaving = paint * direct
        for _ in range(BOUNCES - 1):
            leaving = paint * (direct + between @ leaving)
        steps = (
            _fill_invalid(charts, is_valid, np.asarray(transfer @ leaving, np.float32)) / INTERREFLECTION_STEP
        )
        bands.append(_in_atlas(charts, np.asarray(np.clip(steps, 0, 65535), np.uint16)).T)
    return _in_atlas(charts, visibility), np.ascontiguousarray(bands)


def _visibility(charts: Charts, rays: NodeVisibility, is_valid: BoolArray) -> ByteArray:
    """Return the (N, 4) code of V, corrected so that the irradiance of an open node and of a uniform sky is exact."""
    directions = rays.directions.astype(np.float32)
    above = (rays.cosines > 0).astype(np.float32)
    count = np.maximum(above.sum(axis=1), 1)[:, None]
    free = rays.is_open.astype(np.float32)
    b = 1.5 * (free @ directions) / count
    # correction for the discrete directions: the irradiance of an open face against its exact value
    b -= (1.5 * (above @ directions) / count - 0.75 * charts.normals) * (free.sum(axis=1)[:, None] / count)
    share = (rays.cosines * free).sum(axis=1) / np.maximum(rays.cosines.sum(axis=1), 1e-9)
    a = share - 2 / 3 * np.einsum("nc,nc->n", b, charts.normals)
    coded = np.column_stack([b / (2 * LARGEST_SLOPE) + 0.5, a])
    coded = _fill_invalid(charts, is_valid, np.asarray(coded, np.float32))
    return np.asarray(np.clip(coded * 255 + 0.5, 0, 255), np.uint8)


def _in_atlas(charts: Charts, values: np.typing.NDArray[_T]) -> np.typing.NDArray[_T]:
    """Return (A, n) values (N, n) of the nodes in the order of the atlas's texels."""
    image = np.zeros((charts.size_px[0] * charts.size_px[1], values.shape[1]), values.dtype)
    image[charts.atlas_index] = values
    return image


def _patches(charts: Charts, side: int) -> tuple[IntArray, int]:
    """Return the (N,) patch of each node and the number of patches: squares of nodes of one chart."""
    index = np.arange(len(charts.chart)) - charts.first[charts.chart]
    across = charts.counts[charts.chart, 0]
    i, j = index % across // side, index // across // side
    # combined into one number, sorted in this order
    number = (charts.chart * (i.max() + 1) + i) * (j.max() + 1) + j
    _, patch = np.unique(number, return_inverse=True)
    return patch, int(patch.max()) + 1


def _fill_invalid(charts: Charts, is_valid: BoolArray, values: FloatArray) -> FloatArray:
    """Return values (N, n) with invalid nodes replaced by the mean of valid neighbours in their chart."""
    width, height = charts.size_px
    owner = np.full((height + 2) * (width + 2), -1)
    node = np.zeros_like(owner)
    y, x = np.divmod(charts.atlas_index, width)
    texel = (y + 1) * (width + 2) + x + 1
    owner[texel], node[texel] = charts.chart, np.arange(len(texel))
    is_known, out = is_valid.copy(), values.copy()
    steps = [
        (dy * (width + 2) + dx, (2 - abs(dy)) * (2 - abs(dx)) / 4) for dy in (-1, 0, 1) for dx in (-1, 0, 1)
    ]
    for _ in range(4):
        missing = np.flatnonzero(~is_known)
        total = np.zeros((len(missing), values.shape[1]), np.float32)
        weight = np.zeros(len(missing), np.float32)
        for step, w in steps:
            near = node[texel[missing] + step]
            has_source = (owner[texel[missing] + step] == charts.chart[missing]) & is_known[near]
            rows = np.flatnonzero(has_source)  # a few rows of a hundred values each
            total[rows] += np.float32(w) * out[near[rows]]
            weight[rows] += np.float32(w)
        new = weight > 0
        out[missing[new]] = total[new] / weight[new, None]
        is_known[missing[new]] = True
    return out
