"""Tango path traced by Mitsuba 3: the same mesh, materials, Sun, even sky and camera, as an independent picture.

Needs the extra ``[validation]``. Mitsuba's LLVM back end needs a libLLVM of its own (``DRJIT_LIBLLVM_PATH``).

References
----------
Jakob et al. (2022), Mitsuba 3 renderer, https://mitsuba-renderer.org.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from simulator.errors import UserError
from simulator.render.skylight import spiral
from simulator.render.view import SUN_RADIUS_M
from simulator.scene.bands import ASTRONOMICAL_UNIT_M, reflectance, sun_irradiance_w_m2
from simulator.world.rotation import matrix_from_quat

if TYPE_CHECKING:
    from simulator.arrays import FloatArray
    from simulator.scene.state import SceneState
    from simulator.targets.model import Material, Target

SUN_POINTS = 32
DEPTH = 6


@dataclass(frozen=True)
class Difference:
    """Relative difference of radiance on the target's inner pixels."""

    median: float
    p95: float


def difference(ours: FloatArray, theirs: FloatArray, inner: FloatArray) -> Difference:
    """Compare two pictures.

    Parameters
    ----------
    inner : pixels wholly on the target. Those below 2 % of the brightest are left out.
    """
    chosen = inner & (theirs > 0.02 * np.percentile(theirs[inner], 99.9))
    relative = np.abs(ours[chosen] / theirs[chosen] - 1)
    return Difference(float(np.median(relative)), float(np.percentile(relative, 95)))


def load() -> Any:  # noqa: ANN401 - a module without types
    """Mitsuba with its LLVM back end.

    Raises
    ------
    UserError
        If it is not installed, or finds no LLVM that it can use.
    """
    try:
        import mitsuba  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise UserError("Mitsuba is not installed: pip install 'flyaround[validation]'") from error
    try:
        mitsuba.set_variant("llvm_ad_rgb")
    except (ImportError, RuntimeError) as error:
        where = os.environ.get("DRJIT_LIBLLVM_PATH", "not set")
        raise UserError(
            f"Mitsuba finds no LLVM (DRJIT_LIBLLVM_PATH is {where}); install libllvm19 and name its libLLVM.so there"
        ) from error
    return mitsuba


def path_trace(scene: SceneState, target: Target, sky_w_m2_sr: float, spp: int) -> FloatArray:
    """(H, W) radiance in the panchromatic band, under the scene's Sun and the same sky from everywhere.

    Parameters
    ----------
    scene : square camera, no lens, mono. spp : samples per pixel.
    """
    mi = load()
    _register(mi)
    with TemporaryDirectory() as folder:
        return _render(mi, scene, target, sky_w_m2_sr, spp, Path(folder))


def _render(mi: Any, scene: SceneState, target: Target, sky: float, spp: int, folder: Path) -> FloatArray:  # noqa: ANN401
    camera = scene.camera
    R = matrix_from_quat(scene.q_camera_from_target_wxyz)
    t = np.asarray(scene.t_camera_from_target_m)
    world: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [sky] * 3}},
        "sensor": {
            "type": "perspective",
            "fov": float(np.degrees(2 * np.arctan(camera.width_px / 2 / camera.fx_px))),
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, -1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": camera.width_px,
                "height": camera.height_px,
                "rfilter": {"type": "box"},
                "pixel_format": "luminance",
            },
            "sampler": {"type": "independent", "sample_count": spp, "seed": 1},
        },
    }
    world |= _suns(scene)
    for material in target.materials:
        parts = [part for part in target.parts if part.material == material.name]
        if parts:
            path = folder / f"{material.name}.ply"
            _write_ply(mi, path, [(p.positions_m @ R.T + t, p.normals @ R.T, p.triangles) for p in parts])
            world[f"mesh_{material.name}"] = {"type": "ply", "filename": str(path), "bsdf": _bsdf(material)}
    image = np.array(mi.render(mi.load_dict(world), spp=spp))
    return np.asarray(image[..., 0], float)


def _suns(scene: SceneState) -> dict[str, Any]:
    """The Sun's disc as points even over it."""
    if not scene.sun_visible_fraction:
        return {}
    sun = np.asarray(scene.sun_direction_camera)
    x = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.9 else [1.0, 0.0, 0.0])
    x = x / np.linalg.norm(x)
    cap = spiral(SUN_POINTS, float(np.cos(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M)))
    irradiance = float(sun_irradiance_w_m2("mono", ASTRONOMICAL_UNIT_M)[0]) * scene.sun_visible_fraction
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
    """Materials of glTF 2.0 with KHR_materials_clearcoat, written again from their specifications."""
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
            self.shares = (0.5, 0.3, 0.2) if self.coat else (0.6, 0.4, 0.0)
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

        def _density(self, wi: Any, wo: Any) -> Any:  # noqa: ANN401
            h = dr.normalize(wi + wo)
            total = self.shares[0] * wo.z / dr.pi
            for share, alpha in zip(self.shares[1:], (self.alpha, self.coat_alpha), strict=True):
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

            first, second = self.shares[0], self.shares[0] + self.shares[1]
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
