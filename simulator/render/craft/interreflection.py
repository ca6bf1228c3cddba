"""Light that the parts of a craft reflect on each other in one frame, as textures on the atlas of its charts."""

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

_NEIGHBOURS = 5  # directions that the Sun's is interpolated between
_SKY_SAMPLES = 64  # directions over the Earth's disc


class AtlasTextures:
    """Baked radiance transfer on the GPU: sky visibility, and the interreflected light of the current frame.

    Parameters
    ----------
    pair : tuple of Texture
        Two textures of the atlas's size.
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
        """Set ``interreflection`` [W m-2] to that of a view."""
        R = view.R_camera_from_target
        far = ((view.sun_direction, view.sun_irradiance_w_m2 * view.sun_share), *view.lights)
        sources = [(*_between(self._transfer.directions, R.T @ towards), light) for towards, light in far]
        sky = sky_harmonics(view.sky, R)
        state = b"".join(np.asarray(x).tobytes() for x in (*(x for source in sources for x in source), sky))
        if state == self._last:
            return
        self._last = state
        for band, (table, even) in enumerate(
            zip(self._transfer.interreflected, self._transfer.interreflected_sky, strict=True)
        ):
            light = _weighted(sky[band], even)
            for rows, shares, falling in sources:
                if falling[band] > 0:
                    step = falling[band] * INTERREFLECTION_STEP
                    light += _weighted(step * shares, table[rows].astype(np.float32))
            np.maximum(light, 0, out=self._image[:, band])
        self.interreflection.write(self._image, alignment=1)

    def release(self) -> None:
        """Free the textures."""
        self.visibility.release()
        self.interreflection.release()


class Interreflection:
    """Textures of one craft, made when its light is first needed in some bands.

    Parameters
    ----------
    patch : int, optional
        Size of a patch, as in `baked_transfer`.
    """

    def __init__(self, context: moderngl.Context, mesh: GpuMesh, patch: int = PATCH) -> None:
        self._context, self._mesh, self._patch = context, mesh, patch
        self._begun: dict[Bands, Future[RadianceTransfer]] = {}
        self._empty: dict[Bands, tuple[moderngl.Texture, moderngl.Texture]] = {}
        self._kept: dict[Bands, AtlasTextures] = {}

    def begin(self, bands: Bands) -> None:
        """Start baking on another thread, if it has not been done: it takes a second and needs no OpenGL."""
        if bands in self._kept or bands in self._begun:
            return
        size, channels = self._mesh.charts.size_px, 1 if bands == "mono" else 4
        # 32-bit floats, with four channels for three bands: a software driver samples them as fast as 16-bit ones, and
        # converting to those takes as long as all the rest
        pair = self._context.texture(size, 4), self._context.texture(size, channels, dtype="f4")
        for texture in pair:
            texture.filter = (self._context.LINEAR, self._context.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        self._empty[bands] = pair
        pool = ThreadPoolExecutor(1)
        share = _mean_reflectance(self._mesh.materials, bands)
        self._begun[bands] = pool.submit(baked_transfer, self._mesh, share, self._patch)
        watch_steps({"light between the parts": self._begun[bands]})
        pool.shutdown(wait=False)

    def bake(self, bands: Bands) -> AtlasTextures:
        """Return the textures, as last updated."""
        if bands not in self._kept:
            self.begin(bands)
            self._kept[bands] = AtlasTextures(self._empty.pop(bands), self._begun.pop(bands).result())
        return self._kept[bands]

    def update(self, bands: Bands, view: View) -> AtlasTextures:
        """Return the textures, updated for a view."""
        textures = self.bake(bands)
        textures.update(view)
        return textures

    def release(self) -> None:
        """Free the textures."""
        for textures in self._kept.values():
            textures.release()
        for texture in (one for pair in self._empty.values() for one in pair):
            texture.release()
        for textures_by_bands in (self._kept, self._empty, self._begun):
            textures_by_bands.clear()


def _mean_reflectance(materials: Sequence[Material], bands: Bands) -> FloatArray:
    """Return (M, n) directional-hemispherical reflectance of each material, averaged over directions, with gloss."""
    base = np.asarray([reflectance(bands, np.asarray(m.base_color)) for m in materials], float)
    metallic, coat = (np.array([[getattr(m, name)] for m in materials]) for name in ("metallic", "clearcoat"))
    f0 = 0.04 + (base - 0.04) * metallic
    gloss = f0 + (1 - f0) / 21  # Schlick's reflectance averaged over a hemisphere
    under = gloss + (1 - gloss) * base * (1 - metallic)
    film = coat * (0.04 + 0.96 / 21)
    return np.asarray(film + (1 - film) * under)


def _weighted(weights: FloatArray, rows: Float32Array) -> Float32Array:
    """Return (N,) the weighted sum of rows (K, N); a BLAS product would depend on its number of threads."""
    return np.asarray(np.einsum("k,kn->n", weights.astype(np.float32), rows))


def _between(directions: FloatArray, towards: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return rows and weights (K,) of the directions nearest to one; weights reach zero where the next would enter."""
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
