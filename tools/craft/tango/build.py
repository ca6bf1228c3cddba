"""Tango, the target of the PRISMA mission and of the SPEED benchmarks, built from numbers."""

from __future__ import annotations

from dataclasses import replace

from flyaround.simulator.runtime.arrays import Quat
from flyaround.simulator.targets.model import Detail, Material, Target
from tools.craft.assemble import Piece, assemble
from tools.craft.mass import MassElement
from tools.craft.tango.brackets import build_brackets
from tools.craft.tango.dimensions import ANTENNA_ROOTS, ANTENNA_TIPS
from tools.craft.tango.fittings import build_fittings
from tools.craft.tango.instruments import build_instruments
from tools.craft.tango.labels import build_keypoints, build_occluders, build_wireframe
from tools.craft.tango.materials import MATERIALS, MLI
from tools.craft.tango.mockup import MATERIALS as MOCKUP_MATERIALS
from tools.craft.tango.mockup import mockup_pieces
from tools.craft.tango.structure import build_antennas, build_body, build_panel

NOTES = (
    "SPEED frame: origin on the bottom plate, z out of the solar panel. Keypoints are the published labels "
    "of the SPEED data set; sizes of fittings were measured from public pictures; the mass distribution is "
    "an estimate."
)
HALF = 0.5**0.5  # sine of 45 degrees
SYMMETRY: tuple[Quat, ...] = ((HALF, 0.0, 0.0, HALF), (0.0, 0.0, 0.0, 1.0), (HALF, 0.0, 0.0, -HALF))
"""Quarter turns about z: the nearly square panel and body look alike but for offset and antennas."""


SMALL = frozenset(
    (
        "side_bolts",
        "rod_bolts",
        "plate_bolts",
        "side_marks",
        "connector_sockets",
        "side_box_windows",
        "bottom_covers",
    )
)
"""Parts under a centimetre that carry no label: left out at medium and low detail."""
FINE = frozenset(
    (
        "antenna_collars", "corner_trusses", "plate_pins", "bottom_instrument_caps", "spike_bases", "spike_plates",
        "connector_windows", "plate_standoffs", "bar_posts", "bar_apertures", "rod_clips", "side_brackets",
    )
)  # fmt: skip
"""Parts of a few centimetres that carry no label: left out at low detail besides."""


def build_tango(detail: Detail = "full") -> Target:
    """Return Tango with painted plates, as in SPEED's synthetic images."""
    return _assemble("tango", "Tango (PRISMA), SPEED frame, painted sides", _pieces(detail), MATERIALS)


def build_tango_mockup(detail: Detail = "full") -> Target:
    """Return Tango as a mock-up in a laboratory."""
    pieces = mockup_pieces(_pieces(detail), detail)
    return _assemble(
        "tango-mockup", "Tango (PRISMA), SPEED frame, a laboratory's mock-up", pieces, MOCKUP_MATERIALS
    )


def build_tango_mli(detail: Detail = "full") -> Target:
    """Return Tango with multi-layer insulation on the sides of its body."""
    wrapped = [
        replace(p, material="mli") if p.name.startswith(("body_side_sheet", "body_cover")) else p
        for p in _pieces(detail)
    ]
    return _assemble(
        "tango-mli",
        "Tango (PRISMA), SPEED frame, body sides in golden insulation",
        wrapped,
        (*MATERIALS, MLI),
    )


def _pieces(detail: Detail) -> list[Piece]:
    left_out = {"full": frozenset[str](), "medium": SMALL, "low": SMALL | FINE}[detail]
    pieces = [
        *build_panel(detail),
        *build_body(),
        *build_antennas(detail),
        *build_brackets(detail),
        *build_instruments(detail),
        *build_fittings(detail),
    ]
    return [p for p in pieces if p.name not in left_out]


def _assemble(name: str, title: str, pieces: list[Piece], materials: tuple[Material, ...]) -> Target:
    return assemble(
        name,
        title,
        pieces=pieces,
        materials=materials,
        keypoints=build_keypoints(),
        wireframe=build_wireframe(),
        occluders=build_occluders(),
        lumps=MASS_ELEMENTS,
        frames={
            "panel": ((0.0, 0.0, 0.3215), (0.0, 0.0, 1.0)),
            "bottom": ((0.0, 0.02, 0.0), (0.0, 0.0, -1.0)),
        },
        symmetry=SYMMETRY,
        notes=NOTES,
    )


# Public figures for Tango are 40 to 50 kg; how the mass is spread is not public. The shares follow common
# small-satellite budgets (structure 20 to 25 %, power 20 to 30 %, the rest avionics and payload).
MASS_ELEMENTS = (
    MassElement("avionics and battery", 30.0, (0.0, 0.02, 0.115), size_m=(0.62, 0.46, 0.19)),
    MassElement("bottom plate and instruments", 5.5, (0.0, 0.02, 0.011), size_m=(0.74, 0.568, 0.022)),
    MassElement("side plate -x", 2.4, (-0.362, 0.02, 0.145), size_m=(0.016, 0.568, 0.29)),
    MassElement("side plate +x", 2.4, (0.362, 0.02, 0.145), size_m=(0.016, 0.568, 0.29)),
    MassElement("cover -y", 1.2, (0.0, -0.262, 0.145), size_m=(0.708, 0.004, 0.246)),
    MassElement("cover +y", 1.6, (0.0, 0.302, 0.145), size_m=(0.708, 0.004, 0.246)),
    MassElement("solar panel", 4.6, (0.0, 0.0, 0.3105), size_m=(0.74, 0.77, 0.022)),
    *(
        MassElement(f"antenna {k + 1}", 0.6, root, tip_m=tip)
        for k, (root, tip) in enumerate(zip(ANTENNA_ROOTS, ANTENNA_TIPS, strict=True))
    ),
    MassElement("connectors and fittings", 0.5, (0.01, 0.42, 0.30), size_m=(0.14, 0.08, 0.03)),
)
