"""Targets resident on the GPU: the resources of each, and which of them stay."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from simulator.render.target.shadow_frustum import SurfacePatches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from simulator.render.target.edge_pass import EdgeBuffers
    from simulator.render.target.interreflection import Interreflection
    from simulator.render.target.mesh import GpuMesh
    from simulator.render.target.mesh_array import MeshArray
    from simulator.render.target.textures import Textures
    from simulator.targets.model import Target

MOST_LOADED = 4  # targets that stay on the GPU: tens of megabytes each; others are uploaded again


@dataclass(frozen=True, eq=False)
class ResidentTarget:
    """A target on the GPU with a vertex array per program."""

    mesh: GpuMesh
    shadow: MeshArray
    gbuffer: MeshArray
    edges: EdgeBuffers
    interreflection: Interreflection
    textures: Textures | None = None

    @cached_property
    def patches(self) -> SurfacePatches:
        """Its surface in patches, for views of a part of it."""
        return SurfacePatches.of(self.mesh, self.mesh.values[:, :3].astype(float))

    def release(self) -> None:
        """Free it."""
        for resource in (self.mesh, self.shadow, self.gbuffer, self.edges, self.interreflection):
            resource.release()
        if self.textures is not None:
            self.textures.release()


class ResidentTargets:
    """The targets drawn last, by their SHA-256; the preset `high` has its own.

    Parameters
    ----------
    upload : makes one; ``fine`` with nodes of baked light closer together. forgotten : is told the SHA-256 of a target
        of which the coarser form is about to be freed.
    """

    def __init__(
        self, upload: Callable[[Target, bool], ResidentTarget], forgotten: Callable[[str], None]
    ) -> None:
        self._upload, self._forgotten = upload, forgotten
        self._kept: dict[tuple[str, bool], ResidentTarget] = {}

    def get(self, target: Target, *, fine: bool = False) -> ResidentTarget:
        """A target on the GPU, uploaded now if it is not there."""
        key = target.sha256, fine
        # the last used is the last of them
        loaded = self._kept.pop(key, None) or self._upload(target, fine)
        self._kept[key] = loaded
        while len(self._kept) > MOST_LOADED:
            self._forget(next(iter(self._kept)))
        return loaded

    def __iter__(self) -> Iterator[ResidentTarget]:
        return iter(self._kept.values())

    def release(self) -> None:
        """Free them all."""
        for key in tuple(self._kept):
            self._forget(key)

    def _forget(self, key: tuple[str, bool]) -> None:
        if not key[1]:  # labels are drawn from the coarser form in every preset
            self._forgotten(key[0])
        self._kept.pop(key).release()
