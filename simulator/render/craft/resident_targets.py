"""Targets resident on the GPU: their resources, and eviction of the least recently used."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.charts import TEXEL
from flyaround.simulator.baking.radiance_transfer import PATCH
from flyaround.simulator.render.craft.interreflection import Interreflection
from flyaround.simulator.render.craft.mesh import upload
from flyaround.simulator.render.craft.mesh_array import LabelArrays, WholeMesh, sample_program, shadow_program
from flyaround.simulator.render.craft.shadow_frustum import SurfacePatches
from flyaround.simulator.render.craft.textures import Textures
from flyaround.simulator.render.craft.visible_edges import VisibleEdges

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.mesh_array import Culling, MeshArray
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.targets.model import Target

FINE_TEXEL, FINE_PATCH = 0.012, 2
"""Baked light in the preset `high`: distance of its nodes over the target's radius, and nodes along a patch."""
MAX_CUTS = 8  # cut meshes per target: an approach needs two more each time that the range halves
MAX_RESIDENT = 4  # targets kept on the GPU, tens of megabytes each


class EdgeBuffers:
    """The edges of one mesh on the GPU, and the list of those drawn in this frame."""

    def __init__(self, context: moderngl.Context, visible_edges: VisibleEdges) -> None:
        self._context = context
        self._arrays: dict[Program, moderngl.VertexArray] = {}
        self.visible_edges = visible_edges
        self.vertices = context.buffer(visible_edges.edges.quads().tobytes() or b"\0")
        self.indices = context.buffer(reserve=max(4 * 6 * len(visible_edges.edges.ends), 4), dynamic=True)

    def vertex_array(self, program: Program, layout: str, names: list[str]) -> moderngl.VertexArray:
        """Return the vertex array of the edges for a program. It is kept here, so that it is freed with the mesh."""
        if program not in self._arrays:
            content = [(self.vertices, layout, *names)]
            self._arrays[program] = self._context.vertex_array(program.gl, content, self.indices)
        return self._arrays[program]

    def release(self) -> None:
        """Free the buffers and vertex arrays."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self.vertices.release()
        self.indices.release()


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """A mesh as the passes draw it: uncut, or with its long edges cut so that they follow a lens's distortion."""

    mesh: GpuMesh
    gbuffer: MeshArray
    edges: EdgeBuffers
    make_labels: Callable[[GpuMesh], LabelArrays]

    @cached_property
    def labels(self) -> LabelArrays:
        """Vertex arrays for labels, made with the first labels."""
        return self.make_labels(self.mesh)

    def release(self) -> None:
        """Free the resources of this cut."""
        self.gbuffer.release()
        self.edges.release()
        if "labels" in self.__dict__:
            self.labels.release()


@dataclass(frozen=True, eq=False)
class ResidentTarget:
    """A target on the GPU with a vertex array per program.

    Parameters
    ----------
    mesh : GpuMesh
        The uncut mesh.
    visible_edges : VisibleEdges
        Edges of the uncut mesh.
    shadow : MeshArray
        Vertex array of the shadow program.
    interreflection : Interreflection
        Radiance transfer of the craft.
    draw : callable
        Function that makes a `DrawnMesh` of a mesh and its edges.
    textures : Textures or None, optional
        Textures of the materials, or None.
    cuts : dict of float to DrawnMesh, optional
        Drawn meshes by their longest edge [m].
    """

    mesh: GpuMesh
    visible_edges: VisibleEdges
    shadow: MeshArray
    interreflection: Interreflection
    draw: Callable[[GpuMesh, VisibleEdges], DrawnMesh]
    textures: Textures | None = None
    cuts: dict[float, DrawnMesh] = field(default_factory=dict)

    def drawn(self, context: moderngl.Context, longest_m: float) -> DrawnMesh:
        """Return the mesh with no edge longer than ``longest_m`` [m], from the cache if it was used recently."""
        drawn = self.cuts.pop(longest_m, None)
        if drawn is None:
            mesh = self.mesh if np.isinf(longest_m) else self.mesh.cut(context, longest_m)
            drawn = self.draw(mesh, self.visible_edges.cut(longest_m))
        self.cuts[longest_m] = drawn  # last in order: most recently used
        while len(self.cuts) > MAX_CUTS:
            self._release_cut(next(iter(self.cuts)))
        return drawn

    def _release_cut(self, longest_m: float) -> None:
        drawn = self.cuts.pop(longest_m)
        drawn.release()
        if drawn.mesh is not self.mesh:
            drawn.mesh.release()

    @cached_property
    def patches(self) -> SurfacePatches:
        """Patches of the surface, for views that show only a part of it."""
        return SurfacePatches.from_mesh(self.mesh, self.mesh.values[:, :3].astype(float))

    def release(self) -> None:
        """Free the resources."""
        for longest_m in tuple(self.cuts):
            self._release_cut(longest_m)
        for resource in (self.mesh, self.shadow, self.interreflection):
            resource.release()
        if self.textures is not None:
            self.textures.release()


class ResidentTargets:
    """Cache of the targets on the GPU, by SHA-256 of their files.

    Vertex arrays belong to programs, and programs to a kind of lens, so targets are cached for each kind of lens. They
    are also cached for each density of baked light: `high` has denser nodes. Labels use the coarse one.
    """

    def __init__(self, device: Device, culling: Culling) -> None:
        self.culling = culling
        self._context, self._programs = device.context, device.programs
        self._by_lens: dict[bool, dict[tuple[str, bool], ResidentTarget]] = {False: {}, True: {}}

    def get(self, target: Target, *, fine: bool = False) -> ResidentTarget:
        """Return a target on the GPU; upload it if necessary.

        Parameters
        ----------
        target : Target
            Target to draw.
        fine : bool, optional
            True for the dense baked light of `high`.
        """
        resident, key = self._by_lens[self._programs.lens], (target.sha256, fine)
        # last in order: most recently used
        entry = resident.pop(key, None) or self._upload(target, fine=fine)
        resident[key] = entry
        while len(resident) > MAX_RESIDENT:
            resident.pop(next(iter(resident))).release()
        return entry

    def _upload(self, target: Target, *, fine: bool) -> ResidentTarget:
        context, programs = self._context, self._programs
        mesh = upload(context, target, FINE_TEXEL if fine else TEXEL)
        # textures are bound by ranges of the index buffer
        geometry_array = self.culling.mesh_array if mesh.uv is None else WholeMesh

        def draw(cut: GpuMesh, visible_edges: VisibleEdges) -> DrawnMesh:
            return DrawnMesh(
                cut,
                geometry_array(context, cut, sample_program(programs, cut).gl),
                EdgeBuffers(context, visible_edges),
                lambda mesh: LabelArrays.create(context, programs, target, mesh),
            )

        return ResidentTarget(
            mesh,
            VisibleEdges(mesh.edges, mesh),
            self.culling.mesh_array(context, mesh, shadow_program(programs).gl),
            Interreflection(context, mesh, FINE_PATCH if fine else PATCH),
            draw,
            None if mesh.uv is None else Textures(context, target),
        )

    def release(self) -> None:
        """Free all targets."""
        for targets in self._by_lens.values():
            for entry in targets.values():
                entry.release()
            targets.clear()
