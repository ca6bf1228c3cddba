"""Targets resident on the GPU: the resources of each, and which of them stay."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.shadow_frustum import SurfacePatches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import moderngl

    from flyaround.simulator.render.craft.edge_pass import EdgeBuffers
    from flyaround.simulator.render.craft.interreflection import Interreflection
    from flyaround.simulator.render.craft.label_pass import LabelArrays
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.mesh_array import MeshArray
    from flyaround.simulator.render.craft.textures import Textures
    from flyaround.simulator.render.craft.visible_edges import VisibleEdges
    from flyaround.simulator.targets.model import Target

MOST_CUTS = 8  # of one target: an approach needs two more each time that it halves the range
MOST_LOADED = 4  # targets that stay on the GPU: tens of megabytes each; others are uploaded again


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """A mesh as the camera's passes draw it: as it is, or cut for a lens."""

    mesh: GpuMesh
    gbuffer: MeshArray
    edges: EdgeBuffers
    make_labels: Callable[[GpuMesh], LabelArrays]

    @cached_property
    def labels(self) -> LabelArrays:
        """Made with the first labels: many a picture is drawn without."""
        return self.make_labels(self.mesh)

    def release(self) -> None:
        """Free what only this cut has."""
        self.gbuffer.release()
        self.edges.release()
        if "labels" in self.__dict__:
            self.labels.release()


@dataclass(frozen=True, eq=False)
class ResidentTarget:
    """A target on the GPU with a vertex array per program.

    Parameters
    ----------
    seen : its edges. draw : makes what is drawn of some mesh of it.
    """

    mesh: GpuMesh
    seen: VisibleEdges
    shadow: MeshArray
    interreflection: Interreflection
    draw: Callable[[GpuMesh, VisibleEdges], DrawnMesh]
    textures: Textures | None = None
    cuts: dict[float, DrawnMesh] = field(default_factory=dict)

    def drawn(self, context: moderngl.Context, longest_m: float) -> DrawnMesh:
        """The mesh with no edge longer than that."""
        drawn = self.cuts.pop(longest_m, None)
        if drawn is None:
            mesh = self.mesh if np.isinf(longest_m) else self.mesh.cut(context, longest_m)
            drawn = self.draw(mesh, self.seen.cut(longest_m))
        self.cuts[longest_m] = drawn  # the last used is the last of them
        while len(self.cuts) > MOST_CUTS:
            self._forget(next(iter(self.cuts)))
        return drawn

    def _forget(self, longest_m: float) -> None:
        drawn = self.cuts.pop(longest_m)
        drawn.release()
        if drawn.mesh is not self.mesh:
            drawn.mesh.release()

    @cached_property
    def patches(self) -> SurfacePatches:
        """Its surface in patches, for views of a part of it."""
        return SurfacePatches.of(self.mesh, self.mesh.values[:, :3].astype(float))

    def release(self) -> None:
        """Free it."""
        for longest_m in tuple(self.cuts):
            self._forget(longest_m)
        for resource in (self.mesh, self.shadow, self.interreflection):
            resource.release()
        if self.textures is not None:
            self.textures.release()


class ResidentTargets:
    """The targets drawn last, by their SHA-256; the preset `high` has its own.

    Parameters
    ----------
    upload : makes one; ``fine`` with nodes of baked light closer together.
    """

    def __init__(self, upload: Callable[[Target, bool], ResidentTarget]) -> None:
        self._upload = upload
        self._kept: dict[tuple[str, bool], ResidentTarget] = {}

    def get(self, target: Target, *, fine: bool = False) -> ResidentTarget:
        """A target on the GPU, uploaded now if it is not there."""
        key = target.sha256, fine
        # the last used is the last of them
        loaded = self._kept.pop(key, None) or self._upload(target, fine)
        self._kept[key] = loaded
        while len(self._kept) > MOST_LOADED:
            self._kept.pop(next(iter(self._kept))).release()
        return loaded

    def __iter__(self) -> Iterator[ResidentTarget]:
        return iter(self._kept.values())

    def release(self) -> None:
        """Free them all."""
        for loaded in self._kept.values():
            loaded.release()
        self._kept.clear()
