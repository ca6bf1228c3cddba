"""Geometry pass of meshes with textures: beside surface and depth, a sample's colour, metal, roughness, normal."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from simulator.render.passes.gbuffer import GBufferPass
from simulator.scene.illumination.bands import bands_of, reflectance

if TYPE_CHECKING:
    import moderngl

    from simulator.render.mesh import Mesh
    from simulator.render.passes.gbuffer import SampleImages
    from simulator.render.textures import Textures
    from simulator.scene.state import Bands


class TexturedGBufferPass(GBufferPass):
    """The supersampled target with two more words per sample; meshes without textures never meet it."""

    DEFINES: ClassVar[dict[str, object]] = {"TEXTURED": ""}
    SAMPLERS: ClassVar[tuple[str, ...]] = ("t_base_color", "t_metallic_roughness", "t_normal")
    TEXELS: ClassVar[bool] = True

    def run_textured(
        self,
        vertex_array: moderngl.VertexArray,
        size: tuple[int, int],
        mesh: Mesh,
        textures: Textures,
        bands: Bands,
        *,
        cut: bool,
    ) -> SampleImages:
        """Draw the samples of one lattice window, one set of textures after the other; parameters as in `run`."""
        images = self._begin(mesh, size, cut=cut)
        program = self.program(mesh)
        program.set("u_band_from_rgb", _band_from_rgb(bands))
        for draw in mesh.draws:
            color, data, normal = textures.of(draw.material)
            program.bind_textures(t_base_color=color, t_metallic_roughness=data, t_normal=normal)
            material = draw.material
            program.set("u_base_factor", (0.0,) * 4 if material is None else (*material.base_color, 1.0))
            program.set("u_normal_mapped", float(material is not None and material.normal_texture != ""))
            vertex_array.render(vertices=draw.count, first=draw.first)
        images.end()
        return images


def _band_from_rgb(bands: Bands) -> tuple[float, ...]:
    """Columns of the (3, 3) matrix that takes linear RGB to reflectances of the bands; unused rows are zero."""
    matrix = np.zeros((3, 3))
    matrix[: len(bands_of(bands))] = reflectance(bands, np.eye(3)).T
    return tuple(matrix.T.ravel().tolist())
