"""glTF extensions: those read, those without visible effect, those reported, and those refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.glb.read import ANISOTROPY, CLEARCOAT
from flyaround.simulator.targets.importing.read.draco import DRACO

if TYPE_CHECKING:
    from pathlib import Path

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
TEXTURE_TRANSFORM = "KHR_texture_transform"
INSTANCING, VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
READ = {
    DRACO,
    CLEARCOAT,
    ANISOTROPY,
    SPECULAR_GLOSSINESS,
    TEXTURE_TRANSFORM,
    INSTANCING,
    VISIBILITY,
    "KHR_mesh_quantization",
    "EXT_texture_webp",
    # an unreadable image is reported where it is used
    "KHR_texture_basisu",
    "EXT_texture_avif",
    "MSFT_texture_dds",
}
IGNORED_STATEMENTS = {
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_interactivity",
    "KHR_audio_emitter",
    "EXT_mesh_features",
    "EXT_instance_features",
    "EXT_structural_metadata",
    "EXT_feature_metadata",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
    "AGI_articulations",
    "AGI_stk_metadata",
    "VRM",
    "VRMC_vrm",
    "OMI_physics_body",
    "OMI_physics_shape",
    "GOOGLE_backgrounds",
    "GOOGLE_camera_settings",
    "CESIUM_tile_edges",
    "MOZ_hubs_components",
}
LOST = {
    "KHR_materials_transmission": "light that passes through glass (KHR_materials_transmission: drawn opaque)",
    "KHR_materials_diffuse_transmission": "light that passes through sheets (KHR_materials_diffuse_transmission)",
    "KHR_materials_volume": "thickness of glass (KHR_materials_volume)",
    "KHR_materials_volume_scatter": "scattering within (KHR_materials_volume_scatter)",
    "KHR_materials_unlit": "surfaces that take no light (KHR_materials_unlit: drawn lit)",
    "KHR_materials_sheen": "sheen of cloth (KHR_materials_sheen)",
    "KHR_materials_ior": "indices of refraction (KHR_materials_ior)",
    "KHR_materials_specular": "strength and colour of reflections (KHR_materials_specular)",
    "KHR_materials_iridescence": "iridescence (KHR_materials_iridescence)",
    "KHR_materials_dispersion": "dispersion (KHR_materials_dispersion)",
    "KHR_materials_emissive_strength": "emission (KHR_materials_emissive_strength)",
    "KHR_materials_variants": "variants of materials (KHR_materials_variants: the default one is taken)",
    "KHR_lights_punctual": "lights (KHR_lights_punctual)",
    "KHR_lights_environment": "lights (KHR_lights_environment)",
    "EXT_lights_image_based": "lights (EXT_lights_image_based)",
    "EXT_lights_ies": "lights (EXT_lights_ies)",
    "KHR_animation_pointer": "animations (KHR_animation_pointer)",
    "MSFT_lod": "levels of detail (MSFT_lod: the finest is taken)",
    "EXT_mesh_manifold": "the manifold form of meshes (EXT_mesh_manifold: the drawn form is taken)",
    "FB_ngon_encoding": "polygons (FB_ngon_encoding: their triangles are taken)",
}


def check_extensions(path: Path, document: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return the properties by extensions that are not carried over, and notes on unknown extensions.

    Raises
    ------
    UserError
        If its geometry is compressed with meshopt, or it requires an unsupported extension.
    """
    required = document.get("extensionsRequired") or []
    required = list(map(str, required if isinstance(required, list) else [required]))
    present = extension_names(document)
    if any(name in required for name in MESHOPT) or _lacks_plain_data(document):
        raise UserError(
            f"{path} is compressed with meshopt, which is not supported; export it without mesh compression, or "
            "unpack it with `npx @gltf-transform/cli copy IN.glb OUT.glb`"
        )
    for name in required:
        if name not in READ and name not in IGNORED_STATEMENTS and name not in LOST:
            raise UserError(
                f"{path} requires the glTF extension {name[:80]}, which is not supported; export the model without it"
            )
    lost = [LOST[name] for name in present if name in LOST]
    unknown = [
        n
        for n in present
        if n not in READ and n not in IGNORED_STATEMENTS and n not in LOST and n not in MESHOPT
    ]
    notes = []
    if unknown:
        names = ", ".join(name[:80] for name in unknown[:8]) + ", ..." * (len(unknown) > 8)
        notes.append(f"glTF extensions that are not known and were left out: {names}")
    return lost, notes


def extension_names(document: dict[str, Any]) -> list[str]:
    """Return the names of all extensions that a document lists or has, sorted."""
    used = document.get("extensionsUsed") or []
    names = set(map(str, used if isinstance(used, list) else [used]))
    waiting: list[Any] = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, list):
            waiting += [v for v in value if isinstance(v, dict | list)]
        elif isinstance(value, dict):
            extensions = value.get("extensions")
            if isinstance(extensions, dict):
                names |= set(extensions)
            waiting += [v for k, v in value.items() if k != "extras" and isinstance(v, dict | list)]
    return sorted(names)


def _lacks_plain_data(document: dict[str, Any]) -> bool:
    """Return True if a buffer is only a placeholder for meshopt's output."""
    buffers = document.get("buffers")
    return isinstance(buffers, list) and any(
        isinstance(b, dict)
        and "uri" not in b
        and isinstance(b.get("extensions"), dict)
        and any(isinstance(e := b["extensions"].get(name), dict) and e.get("fallback") for name in MESHOPT)
        for b in buffers
    )
