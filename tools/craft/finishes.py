"""The craft's surfaces, one palette: paints, ablator, metals, insulation, cells under cover glass, windows, mirrors.

Reflectances in the middle of the ranges of Gilmore, Spacecraft Thermal Control Handbook, vol. 1 (2002), app. A:
white paint absorbs 0.17 to 0.28 of sunlight, black paint 0.96, aluminised Kapton 0.35 to 0.45, silvered quartz
(optical solar reflectors) 0.05 to 0.10. Metals as in glTF: base colour is the reflectance at normal incidence; their
non-metallic share stands for scattering in machining marks and creases: mirrors alone would show black sky.
Colours of blankets and cells of the crewed craft are judged on public photographs. Tango's own stand in
``tango_materials``, in proportion to its public images.
"""

from __future__ import annotations

from flyaround.simulator.targets.model import Material

FINISHES = (
    Material(name="white-paint", base_color=(0.78, 0.78, 0.76), roughness=0.6),
    Material(name="white-seam", base_color=(0.50, 0.50, 0.49), roughness=0.65),
    Material(name="white-cloth", base_color=(0.74, 0.73, 0.70), roughness=0.8, crinkle=0.12),
    Material(name="black-paint", base_color=(0.04, 0.04, 0.042), roughness=0.6),
    Material(name="grey-paint", base_color=(0.32, 0.32, 0.33), roughness=0.6),
    Material(name="dark-interior", base_color=(0.085, 0.083, 0.080), roughness=0.75),
    Material(name="burnt-ablator", base_color=(0.030, 0.028, 0.026), roughness=0.85),
    Material(name="bare-aluminium", base_color=(0.80, 0.80, 0.80), metallic=0.75, roughness=0.32),
    Material(
        name="machined-aluminium",
        base_color=(0.58, 0.58, 0.59),
        metallic=0.7,
        roughness=0.36,
        anisotropy=0.6,
        grain=(0.0, 0.0, 1.0),  # rings turned about the craft's long axis
        turned=True,
    ),
    Material(
        name="brushed-aluminium",
        base_color=(0.62, 0.62, 0.63),
        metallic=0.6,
        roughness=0.4,
        anisotropy=0.6,
        grain=(1.0, 0.0, 0.0),
    ),
    Material(
        name="brushed-metal",
        base_color=(0.42, 0.41, 0.40),
        metallic=0.5,
        roughness=0.4,
        anisotropy=0.55,
        grain=(0.0, 0.0, 1.0),  # rings and fittings of docking ports, about the craft's long axis
        turned=True,
    ),
    Material(name="titanium", base_color=(0.50, 0.46, 0.42), metallic=0.7, roughness=0.38),
    Material(name="nozzle", base_color=(0.16, 0.14, 0.13), metallic=0.6, roughness=0.45),
    Material(name="nozzle-alloy", base_color=(0.24, 0.21, 0.19), metallic=0.6, roughness=0.45),
    Material(name="spring-steel", base_color=(0.58, 0.55, 0.47), metallic=0.7, roughness=0.35),
    Material(name="mli-gold", base_color=(0.83, 0.60, 0.24), metallic=0.7, roughness=0.33, crinkle=0.9),
    Material(name="mli-silver", base_color=(0.74, 0.74, 0.75), metallic=0.7, roughness=0.35, crinkle=0.8),
    Material(name="mli-black", base_color=(0.045, 0.045, 0.05), roughness=0.4, crinkle=0.7),
    Material(name="blanket-grey-green", base_color=(0.205, 0.215, 0.170), roughness=0.7, crinkle=0.45),
    Material(name="blanket-dark", base_color=(0.110, 0.116, 0.095), roughness=0.7, crinkle=0.45),
    Material(
        name="radiator-mirror", base_color=(0.86, 0.87, 0.90), metallic=0.55, roughness=0.14, clearcoat=0.6
    ),
    Material(
        name="radiator", base_color=(0.70, 0.71, 0.72), roughness=0.3, clearcoat=0.4, clearcoat_roughness=0.15
    ),
    Material(name="carbon-fibre", base_color=(0.06, 0.06, 0.065), roughness=0.5),
    Material(name="kapton-substrate", base_color=(0.30, 0.17, 0.05), roughness=0.5),
    Material(name="busbar", base_color=(0.66, 0.65, 0.62), metallic=0.5, roughness=0.4),
    Material(
        name="lens", base_color=(0.015, 0.012, 0.025), roughness=0.2, clearcoat=1.0, clearcoat_roughness=0.03
    ),
    Material(
        name="window",
        base_color=(0.010, 0.011, 0.013),
        roughness=0.3,
        clearcoat=1.0,
        clearcoat_roughness=0.02,
    ),
    Material(
        name="solar-cell-silicon",
        base_color=(0.010, 0.018, 0.060),
        roughness=0.4,
        clearcoat=1.0,
        clearcoat_roughness=0.05,
    ),
    Material(
        name="solar-cell",
        base_color=(0.012, 0.014, 0.030),
        roughness=0.4,
        clearcoat=1.0,
        clearcoat_roughness=0.04,
    ),
    Material(
        name="solar-cell-black",
        base_color=(0.012, 0.013, 0.020),
        roughness=0.45,
        clearcoat=1.0,
        clearcoat_roughness=0.04,
    ),
    Material(
        name="solar-cell-blue",
        base_color=(0.016, 0.022, 0.070),
        roughness=0.4,
        clearcoat=1.0,
        clearcoat_roughness=0.04,
    ),
    Material(name="cell-substrate", base_color=(0.22, 0.22, 0.21), roughness=0.6),
    Material(name="panel-back", base_color=(0.42, 0.42, 0.40), roughness=0.6),
)
"""All finishes; a craft keeps those that its parts use."""
