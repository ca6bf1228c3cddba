"""Mesh of a target on the GPU: one vertex buffer for all parts, with a material index per vertex."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.baked_mesh import VERTEX, BakedMesh, MergedParts, geometry_of
from flyaround.simulator.baking.charts import TEXEL
from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.subdivision import subdivide
from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.render.craft.cell_lattice import cell_lattices
from flyaround.simulator.render.craft.finishes import has_films
from flyaround.simulator.render.gl.shared_blocks import MAX_MATERIALS

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.baking.baked_mesh import Geometry
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray
    from flyaround.simulator.targets.model import Material, Target

VERTEX_FORMAT = "3f 3f 1f"
ATTRIBUTES = ("in_position_m", "in_normal", "in_material")


@dataclass(frozen=True)
class Draw:
    """A range of the index buffer drawn with one set of textures.

    Parameters
    ----------
    first : int
        First index of the range.
    count : int
        Number of indices.
    material : Material or None
        Material with the textures and factors; None if there are none.
    """

    first: int
    count: int
    material: Material | None


@dataclass(frozen=True, eq=False, kw_only=True)
class GpuMesh(BakedMesh):
    """A baked mesh with its buffers on the GPU.

    Parameters
    ----------
    vertices : Buffer
        Vertices: position, normal and material (``values``).
    indices : Buffer
        Triangles (``triangles``).
    sources : (V,) array
        For each vertex of a cut mesh, a vertex of the uncut mesh on the same part.
    materials : tuple of Material
        Materials; the first has index 1.
    chart_uv : Buffer
        Chart coordinates of the vertices.
    uv : Buffer, optional
        Texture coordinates of the vertices, if any part has a texture.
    draws : tuple of Draw, optional
        Index ranges by set of textures.
    order : tuple of int, optional
        Indices of the target's parts, in the order of the buffers.
    """

    vertices: moderngl.Buffer
    indices: moderngl.Buffer
    sources: IntArray
    materials: tuple[Material, ...]
    chart_uv: moderngl.Buffer
    uv: moderngl.Buffer | None = None
    draws: tuple[Draw, ...] = ()
    order: tuple[int, ...] = ()

    @cached_property
    def area_m2(self) -> float:
        """Area of all triangles [m2]."""
        corners = self.values[:, :3].astype(float)[self.triangles]
        normals = face_vectors(corners)
        return 0.5 * float(np.linalg.norm(normals, axis=1).sum())

    @cached_property
    def cell_lattices(self) -> FloatArray:
        """Lattices of the solar cells; see `cell_lattice.cell_lattices`."""
        numbers = [k for k, m in enumerate(self.materials, start=1) if has_films(m)]
        is_cell = np.isin(self.values[self.triangles[:, 0], 6], numbers)
        return cell_lattices(self.values[:, :3].astype(float), self.triangles[is_cell].astype(np.int64))

    def vertex_array(
        self,
        context: moderngl.Context,
        program: moderngl.Program,
        *extra: tuple[moderngl.Buffer, str, str],
        indices: moderngl.Buffer | None = None,
    ) -> moderngl.VertexArray:
        """Return the mesh's vertex array for a program.

        Parameters
        ----------
        context : Context
            OpenGL context.
        program : Program
            Program that draws the mesh.
        extra : tuple
            Further per-vertex buffers, each with format and name.
        indices : Buffer, optional
            Replaces the indices of all triangles.
        """
        content: list[tuple[moderngl.Buffer, str, *tuple[str, ...]]] = [
            (self.vertices, VERTEX_FORMAT, *ATTRIBUTES),
            *extra,
        ]
        if "in_chart" in program:
            content.append((self.chart_uv, "2f", "in_chart"))
        if self.uv is not None and "in_uv" in program:
            content.append((self.uv, "2f", "in_uv"))
        return context.vertex_array(program, content, indices or self.indices, skip_errors=True)

    def cut(self, context: moderngl.Context, longest_m: float) -> GpuMesh:
        """Return the same surface in new buffers, with no edge longer than ``longest_m`` [m]."""
        subdivision = subdivide(self.values[:, :3].astype(float), self.triangles.astype(np.int64), longest_m)
        values = subdivision.extended(self.values.astype(float))
        new_normals = values[len(self.values) :, 3:6]
        new_normals /= np.maximum(np.linalg.norm(new_normals, axis=1, keepdims=True), 1e-9)
        triangles = subdivision.triangles.astype(np.uint32)

        def extended(buffer: moderngl.Buffer) -> moderngl.Buffer:
            uv = np.frombuffer(buffer.read(), np.float32).reshape(len(self.values), 2)
            return context.buffer(subdivision.extended(uv).tobytes())

        def cut_index(index: int) -> int:
            return 3 * int(subdivision.first[index // 3])

        return replace(
            self,
            values=values,
            triangles=triangles,
            planes=self.planes[subdivision.of],
            boxes=replace(self.boxes, of=self.boxes.of[subdivision.of]),
            sources=subdivision.inherited(self.sources),
            vertices=context.buffer(values.tobytes()),
            indices=context.buffer(triangles.tobytes()),
            chart_uv=extended(self.chart_uv),
            uv=None if self.uv is None else extended(self.uv),
            draws=tuple(
                replace(d, first=cut_index(d.first), count=cut_index(d.first + d.count) - cut_index(d.first))
                for d in self.draws
            ),
        )

    def release(self) -> None:
        """Free the buffers."""
        self.vertices.release()
        self.indices.release()
        self.chart_uv.release()
        if self.uv is not None:
            self.uv.release()


def upload(context: moderngl.Context, target: Target, texel: float = TEXEL) -> GpuMesh:
    """Merge the parts of a target and upload them; see `merge_parts`."""
    geometry, draws, order = merge_parts(target, texel)
    return GpuMesh(
        **{field.name: getattr(geometry, field.name) for field in fields(BakedMesh)},
        vertices=context.buffer(geometry.values.tobytes()),
        indices=context.buffer(geometry.triangles.tobytes()),
        sources=np.arange(len(geometry.values)),
        materials=target.materials,
        chart_uv=context.buffer(geometry.charts.uv.astype(np.float32).tobytes()),
        uv=context.buffer(geometry.uv.tobytes()) if len(geometry.uv) else None,
        draws=draws,
        order=order,
    )


def merge_parts(target: Target, texel: float = TEXEL) -> tuple[Geometry, tuple[Draw, ...], tuple[int, ...]]:
    """Merge the parts of a target and bake its geometry. Needs no OpenGL.

    Parameters
    ----------
    target : Target
        Target to merge.
    texel : float, optional
        Distance of nodes of baked light, over the mesh's radius.

    Returns
    -------
    tuple
        Geometry, and the ``draws`` and ``order`` of `GpuMesh`.

    Raises
    ------
    UserError
        If the target has no triangles, too many materials, or a part names a material it lacks.
    """
    numbers = {material.name: k + 1 for k, material in enumerate(target.materials)}
    if len(numbers) > MAX_MATERIALS:
        raise UserError(
            f"target {target.name} has {len(numbers)} materials and {MAX_MATERIALS} can be drawn; merge some"
        )
    vertices, indices, start = [], [], 0
    uv: list[Float32Array] = []
    draws: list[Draw] = []
    textured = {m.name: m for m in target.materials if any(m.textures)}
    first = 0
    # parts of one material are consecutive, so each set of textures is bound once
    names = [part.material if part.material in textured else "" for part in target.parts]
    order = sorted(range(len(names)), key=names.__getitem__)
    for part in (target.parts[k] for k in order):
        if part.material not in numbers:
            raise UserError(
                f"part {part.name} of target {target.name} names the material {part.material!r}, which the target "
                "does not define; add it to the target's materials"
            )
        block = np.zeros(len(part.positions_m), VERTEX)
        block["position_m"], block["normal"] = part.positions_m, part.normals
        block["material"] = numbers[part.material]
        vertices.append(block)
        indices.append(np.asarray(part.triangles, np.uint32).ravel() + np.uint32(start))
        start += len(block)
        if textured:
            uv.append(np.zeros((len(block), 2), np.float32) if part.uv is None else part.uv)
            material = textured.get(part.material)
            if draws and draws[-1].material == material:
                draws[-1] = replace(draws[-1], count=draws[-1].count + len(indices[-1]))
            else:
                draws.append(Draw(first, len(indices[-1]), material))
            first += len(indices[-1])
    if not sum(len(block) for block in indices):
        raise UserError(f"target {target.name} has no triangles; give it at least one part with faces")
    geometry = geometry_of(
        MergedParts(
            np.concatenate(vertices),
            np.concatenate(indices).reshape(-1, 3),
            np.concatenate(uv).astype(np.float32) if textured else np.zeros((0, 2), np.float32),
        ),
        target.parts,
        numbers,
        texel,
    )
    return geometry, tuple(draws), tuple(order)
