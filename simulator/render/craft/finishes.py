"""Surface finishes of the target's shader: creased foil, solar cells under coated glass, mottled sheets.

Sizes and amplitudes that name no source were chosen by eye; docs/targets.md describes the finishes.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.creases import DEVIATION_MAX, SIZE, SLOPE_MAX, VARIANCE
from flyaround.simulator.scene.illumination.bands import bands_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import Quality
    from flyaround.simulator.targets.model import Material

FOIL_ROUGHNESS, FOIL_ROUGHNESS_HIGH = 0.8, 0.4
"""Roughness of the foil between its creases, over the material's roughness, which includes all creases. The second
value is for `high`, which draws smaller creases too."""
_FOIL = {
    "COARSE_M": 0.83,  # width of the tile with facets of 1.5 to 13 cm
    "FINE_M": 0.137,  # width of the tile with facets of 2.5 to 22 mm
    "FINE_SHARE": 0.25,  # slopes of the fine tile over those of the coarse one
    "CREASED_ALPHA": 0.42,  # width of the specular lobe of creases below a millimetre
    "CREASED_BLUR": 0.12,  # width, in cosine, of the fade across the Earth's rim mirrored in a facet
    "SEAM_U_M": 0.53,  # distance between seams along u
    "SEAM_V_M": 0.74,  # distance between seams along v
    "TAPE_M": 0.0125,  # half the width of one-inch tape
    "TAPE_DARKER": 0.1,  # relative darkening of tape against foil
    "CLOUDS_TILES": 0.9,  # size of the mottle, in the radius of a mirrored hemisphere of Earth
    "CLOUDS_CONTRAST": 3.0,
}
_FOIL_HIGH = {
    "COARSE_M": 0.47,
    "FINE_SHARE": 0.4,
    "CREASED_BLUR": 0.0,
    "FINEST_M": 0.031,
    "FINEST_SHARE": 0.16,
}
"""Smaller facets for `high`, down to half a millimetre, and a sharp rim of the Earth in them."""
_CELL = {
    "CELL_TILT": 0.004,  # largest random slope of a cell: neighbouring glasses mirror different directions
    "CELL_UNLIKE": 0.18,  # largest relative difference between cells' film reflectances
    "BUSBAR_M": 0.0004,  # half the width of a busbar; a cell has two
    "FINGER_M": 0.00002,  # half the width of a finger; drawn one by one in `high`
    "FINGER_PITCH_M": 0.0013,
    "CELL_RISE_M": 0.004,  # largest height of a cell's glass over the mean plane
    "CONTACT": 0.22,  # reflectance of silver under glass
}
_SHEET = {
    "MOTTLE_M": 0.9,  # width of the mottle's tile
    "JOINT_M": 0.4,  # distance between joints
    "JOINT_WIDE_M": 0.002,  # width of a joint
    "JOINT_DARKER": 2.5,  # darkening of a joint, in amplitudes of the mottle
}
_WEAR = {
    "FASTENER_M": 0.003,  # radius of a head: M3 to M4 (ISO 4762)
    "FASTENER_PITCH_M": 0.05,  # along both sides of a joint
    "FASTENER_ASIDE_M": 0.012,
    "FASTENER_HEAD": 0.42,  # reflectance of passivated steel
    "WRAP_M": 0.0127,  # half the width of one-inch tape around a rod
    "WRAP_PITCH_M": 0.11,
    "WRAP_DARKER": 0.2,
}
_MOTTLE_AMPLITUDE = {
    "panel-back": 0.16,
    "cell-substrate": 0.14,
    "kapton-substrate": 0.14,
    "carbon-fibre": 0.2,
}
"""Relative amplitude of the mottle, by material."""
PLAIN, ROD, SHEET = 1, 2, 3
"""Kinds of worn surfaces: mottled only; wrapped with tape; jointed, with fasteners."""
_WEAR_BY_MATERIAL = {
    "aluminium": PLAIN + 0.14,
    "antenna-grey": ROD + 0.12,
    "asar-tile": SHEET + 0.1,
    "black-paint": PLAIN + 0.2,
    "brushed-metal": PLAIN + 0.12,
    "burnt-ablator": PLAIN + 0.5,
    "cell-substrate": SHEET + 0.14,
    "end-plate": PLAIN + 0.1,
    "grey-paint": SHEET + 0.15,
    "hard-anodised": PLAIN + 0.1,
    "machined-aluminium": PLAIN + 0.1,
    "nozzle": PLAIN + 0.3,
    "nozzle-alloy": PLAIN + 0.3,
    "panel-back": SHEET + 0.16,
    "panel-frame": PLAIN + 0.12,
    "panel-substrate": PLAIN + 0.25,
    "plate-edge": PLAIN + 0.12,
    "white-paint": SHEET + 0.06,
    "white-seam": PLAIN + 0.1,
    "wing-back": SHEET + 0.1,
}
"""Kind of wear plus relative amplitude of the mottle, for surfaces that have flown, by material. Amplitudes were chosen
by eye."""
_MAX_GLASS_ROUGHNESS = 0.2  # a smoother clear coat is glass
_MAX_CELL_REFLECTANCE = 0.1  # a darker body under a full clear coat is a coated cell or a lens
_N_COVER_GLASS, _N_GLASS_FILM, _N_CELL_FILM, _N_WAFER = 1.5, 1.38, 2.1, 3.8
"""Refractive indices of cover glass, magnesium fluoride, titanium oxide and silicon or gallium arsenide."""
_DESIGN_NM = 600.0  # wavelength at which the films are a quarter wave thick
_MIN_GLASS_COAT = 0.9  # a partial coat is varnish
_FIT_COSINE = 0.5  # cosine at which the coating's reflectance is fitted


def is_foil(material: Material) -> bool:
    """Return True for metallised film: creased, and a mirror between creases."""
    return material.crinkle > 0 and material.metallic > 0


def has_films(material: Material) -> bool:
    """Return True for a cell or a lens: a dark body under polished glass.

    Returns
    -------
    bool
        True if the clear coat is polished, and the base neither metallic nor bright in any channel.
    """
    polished = material.clearcoat > _MIN_GLASS_COAT and material.clearcoat_roughness < _MAX_GLASS_ROUGHNESS
    return polished and max(material.base_color) < _MAX_CELL_REFLECTANCE and material.metallic == 0


def mottle_of(material: Material) -> float:
    """Return the relative amplitude of the mottle of a sheet's reflectance; 0 if it has none."""
    return _MOTTLE_AMPLITUDE.get(material.name, 0.0)


def wear_of(material: Material) -> float:
    """Return the kind of a worn surface plus the relative amplitude of its mottle; 0 for other surfaces."""
    return _WEAR_BY_MATERIAL.get(material.name, 0.0)


@lru_cache(maxsize=8)
def film_reflectance(bands: Bands, cosine: float) -> FloatArray:
    """Return (n,) mean reflectance per band of coated cover glass and the coated cell below it.

    Both films are a quarter wave thick at 600 nm. The rise of Fresnel reflection at grazing angles is left to the
    shader.

    Parameters
    ----------
    bands : Bands
        Spectral bands of the camera.
    cosine : float
        Cosine of the angle of incidence.

    References
    ----------
    Macleod (2010), Thin-film optical filters, section 2.6: one film between two media.
    """
    in_glass = np.sqrt(1 - (1 - cosine**2) / _N_COVER_GLASS**2)
    reflectances = []
    for band in bands_of(bands):
        wavelength = np.arange(band.low_nm, band.high_nm) + 0.5
        glass_film = _one_film(1.0, _N_GLASS_FILM, _N_COVER_GLASS, wavelength, cosine)
        cell_film = _one_film(_N_COVER_GLASS, _N_CELL_FILM, _N_WAFER, wavelength, float(in_glass))
        reflectances.append(float(np.mean(glass_film + (1 - glass_film) ** 2 * cell_film)))
    return np.array(reflectances)


def _one_film(
    above: float, film: float, below: float, wavelength_nm: FloatArray, cosine: float
) -> FloatArray:
    """Return the reflectance of a quarter-wave film between two media.

    Fresnel amplitudes are those of normal incidence; the phase is that of the given angle.
    """
    r1, r2 = (above - film) / (above + film), (film - below) / (film + below)
    in_film = np.sqrt(1 - (above / film) ** 2 * (1 - cosine**2))
    interference = 2 * r1 * r2 * np.cos(np.pi * _DESIGN_NM / wavelength_nm * in_film)
    return np.asarray((r1**2 + r2**2 + interference) / (1 + (r1 * r2) ** 2 + interference))


def finish_defines(
    materials: Sequence[Material], bands: Bands, quality: Quality, lattices: int
) -> dict[str, object]:
    """Return the preprocessor constants of a mesh's finishes, only of those that it has.

    Parameters
    ----------
    materials : sequence of Material
        Materials of the mesh.
    bands : Bands
        Colour bands of the image.
    quality : Quality
        Quality preset.
    lattices : int
        Number of cell lattices.
    """
    defines: dict[str, object] = {}
    worn = quality == "high" and any(map(wear_of, materials))
    if worn or any(m.crinkle > 0 or mottle_of(m) for m in materials):
        levels = {
            "CREASE_SIZE": float(SIZE),
            "CREASE_SLOPE": SLOPE_MAX,
            "CREASE_DEVIATION": DEVIATION_MAX,
            "CREASE_VARIANCE": VARIANCE,
        }
        scales = {"draft": 1, "high": 3}.get(quality, 2)
        finest_foil = _FOIL_HIGH if scales == 3 else {}
        defines |= {"CRINKLE": "", "CREASE_SCALES": scales, **levels, **_FOIL, **finest_foil, **_SHEET}
        if worn:
            defines |= {"WORN": "", **_WEAR}
    if any(m.clearcoat > 0 for m in materials):
        at_normal = film_reflectance(bands, 1.0)
        slope = (film_reflectance(bands, _FIT_COSINE) - at_normal) / (1 - _FIT_COSINE)
        defines |= {"CLEARCOAT": "", "FILM": _glsl(at_normal), "FILM_SLANT": _glsl(slope)}
        if lattices and quality != "draft":
            # the mesh models its busbars
            busbars = {"BUSBAR_M": 0.0} if any(m.name == "busbar" for m in materials) else {}
            all_lattices = " ".join(f"F({k})" for k in range(lattices))
            defines |= {"CELLS": lattices, "FOR_EACH_LATTICE(F)": all_lattices, **_CELL, **busbars}
            defines["FINGERS"] = int(quality == "high")
    return defines


def _glsl(values: FloatArray) -> str:
    """Return a colour as a GLSL constant."""
    text = ", ".join(f"{v:.5f}" for v in values)
    return text if len(values) == 1 else f"vec3({text})"
