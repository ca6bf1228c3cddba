"""Light that the parts of a craft reflect on each other, as textures on the atlas of its charts.

The transfer of light is baked once per craft; each frame weights it by the directions of Sun and sky.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.radiance_transfer import (
    INTERREFLECTION_STEP,
    PATCH,
    baked_transfer,
    harmonics,
)
from flyaround.simulator.geometry.directions import orthonormal_basis, spherical_fibonacci
from flyaround.simulator.runtime.progress import watch_steps
from flyaround.simulator.scene.illumination.bands import reflectance

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Future

    import moderngl

    from flyaround.simulator.baking.radiance_transfer import RadianceTransfer
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.illumination.irradiance import IrradianceField
    from flyaround.simulator.targets.model import Material

# Reflectance of dielectrics at normal incidence (refractive index 1.5), and divisor of the rest: the cosine-weighted
# mean of (1 - cos)^5, Schlick's (1994) approximation, is 1 / 21.
DIELECTRIC_F0, SCHLICK_POWERS = 0.04, 21
_NEIGHBOURS = 5  # baked directions from which the Sun's direction is interpolated
_SKY_SAMPLES = 64  # sampled directions over the Earth's disc


class AtlasTextures:
    """Baked radiance transfer on the GPU: sky visibility, and the interreflected light of the current frame.

    Parameters
    ----------
    pair : tuple of Texture
        Two textures of the atlas's size.
    transfer : RadianceTransfer
        Baked transfer of the craft.
    """

    def __init__(self, pair: tuple[moderngl.Texture, moderngl.Texture], transfer: RadianceTransfer) -> None:
        self._transfer, self.pair = transfer, pair
        self.visibility, self.interreflection = pair
        self._image = np.zeros(
            (self.interreflection.width * self.interreflection.height, self.interreflection.components),
            np.float32,
        )
        self.visibility.write(transfer.visibility.tobytes(), alignment=1)
        self._last: bytes = b""

    def update(self, view: View) -> None:
        """Compute the interreflected light of a view and upload it to ``interreflection`` [W m-2]."""
        R = view.R_camera_from_target
        distant = ((view.sun_direction, view.sun_irradiance_w_m2 * view.sun_share), *view.lights)
        sources = [
            (*_interpolate(self._transfer.directions, R.T @ towards), light) for towards, light in distant
        ]
        sky = sky_harmonics(view.sky, R)
        state = b"".join(np.asarray(x).tobytes() for x in (*(x for source in sources for x in source), sky))
        if state == self._last:
            return
        self._last = state
        for band, (table, uniform_sky) in enumerate(
            zip(self._transfer.interreflected, self._transfer.interreflected_sky, strict=True)
        ):
            light = _weighted_sum(sky[band], uniform_sky)
            for rows, weights, irradiance in sources:
                if irradiance[band] > 0:
                    step = irradiance[band] * INTERREFLECTION_STEP
                    light += _weighted_sum(step * weights, table[rows].astype(np.float32))
            np.maximum(light, 0, out=self._image[:, band])
        self.interreflection.write(self._image, alignment=1)

    def release(self) -> None:
        """Free the textures."""
        self.visibility.release()
        self.interreflection.release()


class Interreflection:
    """Textures of one craft for each set of bands, created when first needed.

    Parameters
    ----------
    context : Context
        OpenGL context.
    mesh : GpuMesh
        Mesh of the craft.
    patch : int, optional
        Size of a patch, as in `baked_transfer`.
    """

    def __init__(self, context: moderngl.Context, mesh: GpuMesh, patch: int = PATCH) -> None:
        self._context, self._mesh, self._patch = context, mesh, patch
        self._pending: dict[Bands, Future[RadianceTransfer]] = {}
        self._unused: dict[Bands, tuple[moderngl.Texture, moderngl.Texture]] = {}
        self._textures: dict[Bands, AtlasTextures] = {}

    def begin(self, bands: Bands) -> None:
        """Start baking on another thread unless it was started before; it takes a second and needs no OpenGL."""
        if bands in self._textures or bands in self._pending:
            return
        size, channels = self._mesh.charts.size_px, 1 if bands == "mono" else 4
        # 32-bit floats: a software driver samples them as fast as 16-bit ones, and the conversion would take as long
        # as the rest of the update
        pair = self._context.texture(size, 4), self._context.texture(size, channels, dtype="f4")
        for texture in pair:
            texture.filter = (self._context.LINEAR, self._context.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        self._unused[bands] = pair
        pool = ThreadPoolExecutor(1)
        share = _mean_reflectance(self._mesh.materials, bands)
        self._pending[bands] = pool.submit(baked_transfer, self._mesh, share, self._patch)
        watch_steps({"light between the parts": self._pending[bands]})
        pool.shutdown(wait=False)

    def bake(self, bands: Bands) -> AtlasTextures:
        """Return the textures as last updated; wait for the baking at the first call."""
        if bands not in self._textures:
            self.begin(bands)
            self._textures[bands] = AtlasTextures(self._unused.pop(bands), self._pending.pop(bands).result())
        return self._textures[bands]

    def update(self, bands: Bands, view: View) -> AtlasTextures:
        """Return the textures, updated for a view."""
        textures = self.bake(bands)
        textures.update(view)
        return textures

    def release(self) -> None:
        """Free the textures."""
        for textures in self._textures.values():
            textures.release()
        for texture in (one for pair in self._unused.values() for one in pair):
            texture.release()
        for textures_by_bands in (self._textures, self._unused, self._pending):
            textures_by_bands.clear()


def _mean_reflectance(materials: Sequence[Material], bands: Bands) -> FloatArray:
    """Return the reflectance (M, n) of each material per band, averaged over the hemisphere, gloss included."""
    base = np.asarray([reflectance(bands, np.asarray(m.base_color)) for m in materials], float)
    metallic, coat = (np.array([[getattr(m, name)] for m in materials]) for name in ("metallic", "clearcoat"))
    f0 = DIELECTRIC_F0 + (base - DIELECTRIC_F0) * metallic
    gloss = f0 + (1 - f0) / SCHLICK_POWERS
    base_layer = gloss + (1 - gloss) * base * (1 - metallic)
    film = coat * (DIELECTRIC_F0 + (1 - DIELECTRIC_F0) / SCHLICK_POWERS)
    return np.asarray(film + (1 - film) * base_layer)


def _weighted_sum(weights: FloatArray, rows: Float32Array) -> Float32Array:
    """Return the weighted sum (N,) of rows (K, N); a BLAS product would depend on the number of threads."""
    return np.asarray(np.einsum("k,kn->n", weights.astype(np.float32), rows))


def _interpolate(directions: FloatArray, towards: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return indices and weights (K,) of the baked directions nearest to ``towards``.

    A direction's weight is zero where another one replaces it, so the light changes continuously.
    """
    cosine = directions @ towards
    rows = np.argsort(-cosine)[: _NEIGHBOURS + 1]
    angle = np.arccos(np.clip(cosine[rows], -1, 1))
    weight = (1 - angle[:-1] / angle[-1]) ** 2
    return np.asarray(rows[:-1], int), np.asarray(weight / weight.sum())


def sky_harmonics(sky: IrradianceField, R_camera_from_target: FloatArray) -> FloatArray:
    """Return (n, 9) coefficients of the sky's radiance in `transfer.harmonics`, target frame."""
    lowest = max(sky.disc_cosine, -1.0)
    cap = spherical_fibonacci(_SKY_SAMPLES, lowest)
    d = cap @ orthonormal_basis(sky.axis)
    linear = sky.radiance_w_m2_sr
    radiance = np.maximum(d @ linear[:, :3].T + linear[:, 3], 0)
    solid_angle = 2 * np.pi * max(1 - lowest, 0.0) / _SKY_SAMPLES
    return np.asarray(radiance.T @ harmonics(d @ R_camera_from_target) * solid_angle)
