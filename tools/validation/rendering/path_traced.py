"""Tango path-traced by Mitsuba 3 as an independent image: the same mesh, materials, Sun, uniform sky and camera.

Needs the extra ``[validation]``, and a newer libLLVM for Mitsuba's LLVM back end than many systems have.

References
----------
Jakob et al. (2022), Mitsuba 3 renderer, https://mitsuba-renderer.org.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.scene.illumination.bands import reflectance, sun_irradiance_w_m2
from flyaround.simulator.world.constants import AU_M, SUN_RADIUS_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Material, Target

SUN_POINTS = 32  # point sources over the Sun's disc
DEPTH = 6  # maximum number of bounces
SAMPLES_PER_PASS = 64  # samples per pixel of one pass
OLDEST_LLVM = 17  # minimum version for Mitsuba's vectorised kernels
# Mitsuba offsets rays from a surface by 9e-5 of (1 + maximum coordinate): in metres, with the camera 6 m away, that is
# 0.6 mm, which moves shadows and opens gaps. The scene is therefore centred on the craft, in centimetres.
UNITS_PER_M = 100.0


@dataclass(frozen=True)
class Difference:
    """Difference between two images.

    Parameters
    ----------
    median : float
        Median relative difference of radiance on the target's inner pixels.
    p95 : float
        95th percentile of that difference.
    flip : float
        Mean HDR-FLIP over the whole image, 0..1, at 67 pixels per degree; NaN without its evaluator.
    """

    median: float
    p95: float
    flip: float


def difference(rendered: FloatArray, reference: FloatArray, inner: FloatArray) -> Difference:
    """Compare two images.

    Parameters
    ----------
    rendered : (H, W) array
        Rendered radiance.
    reference : (H, W) array
        Path-traced radiance.
    inner : array
        Pixels wholly on the target. Those below 2 % of the maximum are excluded from the relative difference.

    References
    ----------
    Andersson et al. (2021), Visualizing errors in rendered high dynamic range images, Eurographics short papers.
    """
    chosen = inner & (reference > 0.02 * np.percentile(reference[inner], 99.9))
    relative = np.abs(rendered[chosen] / reference[chosen] - 1)
    return Difference(
        float(np.median(relative)), float(np.percentile(relative, 95)), _flip(rendered, reference)
    )


def _flip(rendered: FloatArray, reference: FloatArray) -> float:
    try:
        import flip_evaluator  # noqa: PLC0415 - an extra
    except ImportError:
        return float("nan")
    # FLIP's exposures span the light of the reference; the scale itself does not matter
    pictures = [
        np.repeat(np.maximum(x, 0)[..., None], 3, axis=2).astype(np.float32) for x in (reference, rendered)
    ]
    return float(flip_evaluator.evaluate(*pictures, "HDR", inputsRGB=False, applyMagma=False)[1])


def load() -> Any:  # noqa: ANN401 - an untyped module
    """Return Mitsuba with its LLVM back end; unless ``DRJIT_LIBLLVM_PATH`` is set, it is set to the newest libLLVM.

    Raises
    ------
    UserError
        If Mitsuba is not installed, or no LLVM is usable.
    """
    try:
        import mitsuba  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise missing_extra("a path-traced reference", "validation", error) from error
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        libraries = sorted((int(m[1]), str(p)) for p in Path("/usr/lib").glob("*/libLLVM*.so*")
                       if (m := re.match(r"libLLVM[-.a-z]*(\d+)", p.name)))  # fmt: skip
        # Mitsuba ends the process with LLVM 15 and 16 instead of raising
        if not libraries or libraries[-1][0] < OLDEST_LLVM:
            raise UserError(
                f"Mitsuba needs LLVM {OLDEST_LLVM} or newer: apt install libllvm19, or set "
                "DRJIT_LIBLLVM_PATH to a libLLVM.so"
            )
        os.environ["DRJIT_LIBLLVM_PATH"] = libraries[-1][1]
    try:
        mitsuba.set_variant("llvm_ad_rgb")
    except (ImportError, RuntimeError) as error:
        raise UserError(
            f"Mitsuba cannot use the LLVM that DRJIT_LIBLLVM_PATH names ({os.environ['DRJIT_LIBLLVM_PATH']}); name "
            "the libLLVM.so of libllvm19 there"
        ) from error
    return mitsuba


@dataclass(frozen=True, eq=False)
class Traced:
    """A path-traced image.

    Parameters
    ----------
    radiance : (H, W) array
        Radiance in the panchromatic band [W m-2 sr-1].
    noise : (H, W) array
        Standard error of the radiance, from the spread of independent passes.
    """

    radiance: FloatArray
    noise: FloatArray


def path_trace(scene: SceneState, target: Target, sky_w_m2_sr: float, sun_spp: int, sky_spp: int) -> Traced:
    """Return the radiance under the scene's Sun and a uniform sky.

    Sun and sky are traced separately and added: one sampler that chooses between 33 lights is noisier. Results are
    cached in the cache folder: 1000 samples of an image of 320 pixels take a minute on one processor core.

    Parameters
    ----------
    scene : SceneState
        Scene of a square monochrome camera without distortion.
    target : Target
        Target to render.
    sky_w_m2_sr : float
        Radiance of the sky.
    sun_spp : int
        Samples per pixel of sunlight, in passes of `SAMPLES_PER_PASS`.
    sky_spp : int
        Samples per pixel of the sky, in passes of `SAMPLES_PER_PASS`.
    """
    lights: list[tuple[dict[str, Any], int]] = []
    if sky_w_m2_sr > 0:
        sky = {"type": "constant", "radiance": {"type": "rgb", "value": [sky_w_m2_sr] * 3}}
        lights.append(({"sky": sky}, sky_spp))
    if scene.sun_visible_fraction > 0:
        lights.append((_suns(scene), sun_spp))
    traced = [
        cached_array(_key(scene, target, light, spp), partial(_traced, scene, target, light, spp))
        for light, spp in lights
    ]
    radiance, variance = np.sum(traced, axis=0)
    return Traced(radiance, np.sqrt(variance))


def _key(scene: SceneState, target: Target, light: dict[str, Any], spp: int) -> str:
    """Return the file name of the path-traced image for one light."""
    camera = scene.camera
    view = (scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m, camera.width_px, camera.fx_px)
    samples = DEPTH, SAMPLES_PER_PASS
    return entry_name("mitsuba", (_traced,), target.sha256, repr((view, light, spp)), samples)


def _traced(scene: SceneState, target: Target, light: dict[str, Any], spp: int) -> FloatArray:
    """Return the (2, H, W) radiance under one light, and its variance from the spread of its passes."""
    mi = load()
    _register(mi)
    passes = max(2, -(-spp // SAMPLES_PER_PASS))  # all samples of a pass are in memory together
    total = np.zeros((2, scene.camera.height_px, scene.camera.width_px))
    with TemporaryDirectory() as folder:
        meshes = _meshes(mi, scene, target, Path(folder))
        stage = mi.load_dict(_empty_world(mi, scene) | meshes | light)
        for k in range(passes):
            image = np.array(mi.render(stage, spp=-(-spp // passes), seed=k), float)[..., 0]
            total += image, image**2
    mean, square = total / passes
    return np.asarray([mean, np.maximum(square - mean**2, 0) / (passes - 1)])


def _empty_world(mi: Any, scene: SceneState) -> dict[str, Any]:  # noqa: ANN401
    camera = scene.camera
    origin = -UNITS_PER_M * np.asarray(scene.t_camera_from_target_m)
    target = origin + np.array([0.0, 0.0, 1.0])
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH, "rr_depth": DEPTH},
        "sensor": {
            "type": "perspective",
            "fov": float(np.degrees(2 * np.arctan(camera.width_px / 2 / camera.fx_px))),
            "to_world": mi.ScalarTransform4f().look_at(
                origin=list(map(float, origin)), target=list(map(float, target)), up=[0, -1, 0]
            ),
            "film": {
                "type": "hdrfilm",
                "width": camera.width_px,
                "height": camera.height_px,
                "rfilter": {"type": "box"},
                "pixel_format": "luminance",
            },
            "sampler": {"type": "multijitter", "sample_count": SAMPLES_PER_PASS},
        },
    }


def _meshes(mi: Any, scene: SceneState, target: Target, folder: Path) -> dict[str, Any]:  # noqa: ANN401
    """Return the craft in camera axes about its own origin, one mesh per material."""
    R = matrix_from_quat(scene.q_camera_from_target_wxyz)
    meshes: dict[str, Any] = {}
    for material in target.materials:
        parts = [part for part in target.parts if part.material == material.name]
        if parts:
            path = folder / f"{material.name}.ply"
            _write_ply(
                mi, path, [(p.positions_m @ R.T * UNITS_PER_M, p.normals @ R.T, p.triangles) for p in parts]
            )
            meshes[f"mesh_{material.name}"] = {"type": "ply", "filename": str(path), "bsdf": _bsdf(material)}
    return meshes


def _suns(scene: SceneState) -> dict[str, Any]:
    """Return the Sun's disc as evenly distributed points."""
    sun = np.asarray(scene.sun_direction_camera)
    x = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.9 else [1.0, 0.0, 0.0])
    x = x / np.linalg.norm(x)
    cap = spherical_fibonacci(SUN_POINTS, float(np.cos(SUN_RADIUS_M / AU_M)))
    irradiance = float(sun_irradiance_w_m2("mono", AU_M)[0]) * scene.sun_visible_fraction
    return {
        f"sun{k}": {
            "type": "directional",
            "direction": list(map(float, -d)),
            "irradiance": {"type": "rgb", "value": [irradiance / SUN_POINTS] * 3},
        }
        for k, d in enumerate(cap @ np.stack([x, np.cross(sun, x), sun]))
    }


def _bsdf(material: Material) -> dict[str, Any]:
    base = float(reflectance("mono", np.asarray(material.base_color))[0])
    return {
        "type": "flyaround_gltf",
        "base": base,
        "metallic": material.metallic,
        "roughness": max(material.roughness, 0.03),
        "clearcoat": material.clearcoat,
        "coat_roughness": max(material.clearcoat_roughness, 0.03),
    }


def _write_ply(mi: Any, path: Path, pieces: list[tuple[Any, Any, Any]]) -> None:  # noqa: ANN401
    positions = np.concatenate([p for p, _, _ in pieces]).astype(np.float32)
    normals = np.concatenate([n for _, n, _ in pieces]).astype(np.float32)
    starts = np.cumsum([0, *(len(p) for p, _, _ in pieces)])
    faces = np.concatenate([np.asarray(f) + s for (_, _, f), s in zip(pieces, starts, strict=False)])
    mesh = mi.Mesh(path.stem, len(positions), len(faces), has_vertex_normals=True)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = positions.ravel()
    parameters["vertex_normals"] = normals.ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    parameters.update()
    mesh.write_ply(str(path))


def _register(mi: Any) -> None:  # noqa: ANN401
    """Register materials of glTF 2.0 with KHR_materials_clearcoat, written from the specifications."""
    import drjit as dr  # noqa: PLC0415 - comes with Mitsuba

    class Gltf(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:  # noqa: ANN401
            mi.BSDF.__init__(self, props)
            self.base, self.metallic = float(props["base"]), float(props["metallic"])
            self.coat = float(props["clearcoat"])
            self.alpha = float(props["roughness"]) ** 2
            self.coat_alpha = float(props["coat_roughness"]) ** 2
            f0 = 0.04 + (self.base - 0.04) * self.metallic
            under = ((1 - 5 * f0**0.5) / (5 - f0**0.5)) ** 2
            self.f0 = f0 + (under - f0) * self.coat
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [flags]
            self.m_flags = flags

        def _lobe(self, wi: Any, wo: Any, h: Any, alpha: float, f0: float) -> Any:  # noqa: ANN401
            c2 = h.z * h.z
            d = alpha**2 / (dr.pi * dr.square(c2 * (alpha**2 - 1) + 1))
            lam = [dr.sqrt(1 + alpha**2 * (1 - w.z * w.z) / dr.maximum(w.z * w.z, 1e-9)) for w in (wi, wo)]
            masking = 2 / (lam[0] + lam[1])
            fresnel = f0 + (1 - f0) * (1 - dr.dot(wi, h)) ** 5
            return fresnel, d * masking / (4 * wi.z * wo.z)

        def _value(self, wi: Any, wo: Any) -> Any:  # noqa: ANN401
            h = dr.normalize(wi + wo)
            f, gloss = self._lobe(wi, wo, h, self.alpha, self.f0)
            value = (1 - f) * self.base * (1 - self.metallic) / dr.pi + f * gloss
            if self.coat:
                fc, coat = self._lobe(wi, wo, h, self.coat_alpha, 0.04)
                value = value * (1 - fc * self.coat) + self.coat * fc * coat
            return dr.select((wi.z > 1e-4) & (wo.z > 1e-4), value * wo.z, 0)

        def _shares(self, wi: Any) -> Any:  # noqa: ANN401
            """Return the shares of samples for the matt, glossy and coat lobes: their reflectances in this view."""
            fifth = dr.clip(1 - wi.z, 0, 1) ** 5
            gloss, coat = self.f0 + (1 - self.f0) * fifth, self.coat * (0.04 + 0.96 * fifth)
            # microfacets of a rough lobe are flatter than the mean one, so the lobe is never omitted
            parts = [
                self.base * (1 - self.metallic) * (1 - gloss) * (1 - coat),
                (gloss + 0.003) * (1 - coat),
                coat,
            ]
            return [part / (parts[0] + parts[1] + parts[2]) for part in parts]

        def _density(self, wi: Any, wo: Any) -> Any:  # noqa: ANN401
            h = dr.normalize(wi + wo)
            matt, *lobes = self._shares(wi)
            total = matt * wo.z / dr.pi
            for share, alpha in zip(lobes, (self.alpha, self.coat_alpha), strict=True):
                d = alpha**2 / (dr.pi * dr.square(h.z * h.z * (alpha**2 - 1) + 1))
                total += share * d * h.z / (4 * dr.maximum(dr.dot(wi, h), 1e-6))
            return dr.select((wi.z > 1e-4) & (wo.z > 1e-4), total, 0)

        def sample(self, _ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:  # noqa: ANN401, FBT002
            flat = mi.warp.square_to_cosine_hemisphere(sample2)

            def mirrored(alpha: float) -> Any:  # noqa: ANN401
                c = dr.sqrt((1 - sample2.x) / (1 + (alpha**2 - 1) * sample2.x))
                s, turn = dr.sqrt(dr.maximum(1 - c * c, 0)), 2 * dr.pi * sample2.y
                h = mi.Vector3f(s * dr.cos(turn), s * dr.sin(turn), c)
                return 2 * dr.dot(si.wi, h) * h - si.wi

            first, gloss, _ = self._shares(si.wi)
            second = first + gloss
            wo = dr.select(
                sample1 < first,
                flat,
                dr.select(sample1 < second, mirrored(self.alpha), mirrored(self.coat_alpha)),
            )
            bs = mi.BSDFSample3f()
            bs.wo, bs.pdf, bs.eta = wo, self._density(si.wi, wo), 1.0
            bs.sampled_type, bs.sampled_component = mi.UInt32(+self.m_flags), 0
            good = active & (bs.pdf > 0)
            return bs, mi.Color3f(dr.select(good, self._value(si.wi, wo) / dr.maximum(bs.pdf, 1e-20), 0))

        def eval(self, _ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ANN401, FBT002
            return mi.Color3f(dr.select(active, self._value(si.wi, wo), 0))

        def pdf(self, _ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ANN401, FBT002
            return dr.select(active, self._density(si.wi, wo), 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ANN401, FBT002
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    mi.register_bsdf("flyaround_gltf", Gltf)
