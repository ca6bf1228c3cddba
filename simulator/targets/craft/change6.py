"""The ascent vehicle of Chang'e-6, as it waits in lunar orbit for the orbiter's clamps.

Public record: an octagonal body about 1.5 m wide in golden insulation, four spherical tanks, one 3 kN engine below, two
folding wings that are nearly round, small thrusters round the deck, and on top the grips that the orbiter's three claws
pull in and the port through which the samples pass (CNSA and CGTN releases on Chang'e-5 and -6, 2020 and 2024;
Hu et al., Design and verification of the docking mechanism of Chang'e-5, Sci. China Technol. Sci. 2021). About 700 to
800 kg with propellant. Sizes below the body's width are read off published pictures and are estimates.

Frame: origin at the middle of the lower deck's underside, z along the docking axis away from the engine, wings on +-y.
"""

from __future__ import annotations

import itertools

import numpy as np

from simulator.arrays import FloatArray, Vec3, vec3
from simulator.targets.assembly import Piece
from simulator.targets.builders.cells import clipped_rectangle
from simulator.targets.builders.mesh import Mesh, merge
from simulator.targets.builders.prism import circle, prism, rectangle
from simulator.targets.builders.solids import box, cone, lathe, rod, truss
from simulator.targets.craft.assemble import assemble_lumped
from simulator.targets.craft.finishes import FINISHES
from simulator.targets.craft.hardware import bolts, cup, nozzle, sphere, star_tracker, thruster, tube
from simulator.targets.craft.place import both_sides, turn_z
from simulator.targets.craft.wire import prism_edges, rim_point, ring_edges
from simulator.targets.detail import Detail, facets
from simulator.targets.mass import Lump
from simulator.targets.model import Edge, Target

WIDTH_M = 1.50
CUT_M = 0.36
"""The octagon is the square of the body's width with its corners cut by this much."""
DECK_M = 0.035
BODY_TOP_M = 1.02
CORE_INSET_M = 0.035
"""The insulated walls stand this far inside the decks' rims."""
TANK_RADIUS_M, TANK_XY_M, TANK_Z_M = 0.330, 0.535, 0.44
ENGINE_EXIT_M, ENGINE_WALL_M, ENGINE_LENGTH_M, ENGINE_TOP_M = 0.235, 0.006, 0.560, -0.06
WING_RADIUS_M, WING_Y_M, WING_Z_M, WING_PLATE_M = 0.70, 1.56, 0.93, 0.022
WING_SIDES = 16
GRIP_RADIUS_M, GRIP_TOP_M = 0.40, BODY_TOP_M + 0.17
PORT_RADIUS_M, PORT_TOP_M = 0.240, BODY_TOP_M + 0.12
CELL_M = (0.0612, 0.0412)
NOTES = (
    "Origin at the middle of the lower deck, z away from the engine. Width and arrangement from public releases; "
    "other sizes read off pictures; mass split estimated."
)


def octagon(inset_m: float = 0.0) -> FloatArray:
    """(8, 2) outline of a deck, counter-clockwise, moved inwards by ``inset_m``."""
    h = WIDTH_M / 2 - inset_m
    # the cut faces move along the diagonal by the same distance
    return clipped_rectangle(2 * h, 2 * h, CUT_M - inset_m * (2 - 2**0.5), "all")


def wing_outline() -> FloatArray:
    """(16, 2) outline of the wing on +y, a vertex furthest out."""
    return circle((0.0, WING_Y_M), WING_RADIUS_M, WING_SIDES)


def build_change6_ascender(detail: Detail = "full") -> Target:
    """The ascent vehicle, wings deployed."""
    return assemble_lumped(
        "change6-ascender",
        "Chang'e-6 ascent vehicle",
        pieces=[
            *_body(detail),
            *_tanks(detail),
            *_propulsion(detail),
            *_deck(detail),
            *_sides(detail),
            *_wings(detail),
        ],
        materials=FINISHES,
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "docking": ((0.0, 0.0, PORT_TOP_M), (0.0, 0.0, 1.0)),
            "engine": ((0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )


def _body(detail: Detail) -> list[Piece]:
    """Two decks, the insulated walls between them, uprights at the corners, seams of the blankets."""
    core = prism(octagon(CORE_INSET_M), BODY_TOP_M - 2 * DECK_M, origin_m=(0, 0, DECK_M))
    lower = prism(octagon(), DECK_M)
    upper = prism(octagon(), DECK_M, origin_m=(0, 0, BODY_TOP_M - DECK_M))
    blanket = prism(octagon(0.02), 0.006, origin_m=(0, 0, BODY_TOP_M - 0.001))
    pieces = [
        Piece("body_walls", "mli-gold", core),
        Piece("deck_lower", "brushed-aluminium", lower),
        Piece("deck_upper", "brushed-aluminium", upper),
        Piece("deck_blanket", "mli-gold", blanket),
    ]
    if detail != "low":
        ring = octagon(CORE_INSET_M - 0.006)
        n = facets(detail, 12)
        uprights = [rod((x, y, DECK_M), (x, y, BODY_TOP_M - DECK_M), 0.014, n) for x, y in ring]
        pieces.append(Piece("body_uprights", "carbon-fibre", merge(uprights)))
    if detail == "full":
        tape = [
            prism(octagon(CORE_INSET_M - 0.003), 0.018, origin_m=(0, 0, z)) for z in (0.06, BODY_TOP_M - 0.09)
        ]
        pieces.append(Piece("body_seams", "kapton-substrate", merge(tape)))
        points = [(x, y, BODY_TOP_M + 0.005) for x, y in _along(octagon(0.045), 4)]
        pieces.append(Piece("deck_buttons", "bare-aluminium", bolts(points, (0, 0, 1), 0.011, 0.004, detail)))
    return pieces


def _along(outline: FloatArray, count: int) -> list[tuple[float, float]]:
    """Points spread over the sides of a polygon."""
    turned = np.roll(outline, -1, axis=0)
    return [
        (float(x), float(y))
        for a, b in zip(outline, turned, strict=True)
        for x, y in a + (np.arange(count) + 0.5)[:, None] / count * (b - a)
    ]


def _tanks(detail: Detail) -> list[Piece]:
    """Four tanks that bulge out of the cut corners, each in a skirt with struts to the decks."""
    balls, skirts, struts = [], [], []
    for sx, sy in itertools.product((-1, 1), repeat=2):
        c = (sx * TANK_XY_M, sy * TANK_XY_M, TANK_Z_M)
        balls.append(sphere(c, TANK_RADIUS_M, 48, detail))
        skirts.append(
            tube(
                (c[0], c[1], c[2] - 0.02),
                (0, 0, 1),
                TANK_RADIUS_M + 0.014,
                TANK_RADIUS_M - 0.004,
                0.04,
                64,
                detail,
            )
        )
        along = np.array([sx, -sy, 0.0]) / 2**0.5
        out = np.array([sx, sy, 0.0]) / 2**0.5
        rim = [np.asarray(c) + 0.16 * out + s * 0.30 * along for s in (-1, 1)]
        feet = [
            np.array([sx * TANK_XY_M, sy * TANK_XY_M, z]) + s * 0.15 * along
            for s in (-1, 1)
            for z in (0.03, 0.99)
        ]
        nodes = np.array([*rim, *feet])
        struts.append(truss(nodes, [(0, 2), (0, 3), (1, 4), (1, 5)], 0.010, facets(detail, 12)))
    pieces = [Piece("tanks", "mli-silver", merge(balls)), Piece("tank_skirts", "titanium", merge(skirts))]
    if detail != "low":
        pieces.append(Piece("tank_struts", "carbon-fibre", merge(struts)))
    return pieces


def _propulsion(detail: Detail) -> list[Piece]:
    """The main engine with its heat shield, and the attitude thrusters in four pods."""
    bell = nozzle(
        (0, 0, ENGINE_TOP_M), (0, 0, -1), 0.050, ENGINE_EXIT_M, ENGINE_LENGTH_M, ENGINE_WALL_M, 64, detail
    )
    n = facets(detail, 48)
    chamber = lathe(
        [(0, 0), (0.075, 0), (0.075, 0.05), (0.056, 0.085), (0, 0.085)],
        (0, 0, ENGINE_TOP_M - 0.02),
        (0, 0, 1),
        n,
    )
    shield = lathe(
        [(0, 0.0), (0.42, 0.0), (0.40, 0.016), (0, 0.016)], (0, 0, -0.016), (0, 0, 1), facets(detail, 64)
    )
    pieces = [
        Piece("engine_nozzle", "nozzle", bell),
        Piece("engine_chamber", "titanium", chamber),
        Piece("engine_shield", "mli-silver", shield),
    ]
    if detail != "low":
        stiffeners = [
            tube(
                (0, 0, ENGINE_TOP_M - h),
                (0, 0, -1),
                r + ENGINE_WALL_M + 0.006,
                r + ENGINE_WALL_M - 0.002,
                0.008,
                64,
                detail,
            )
            for h, r in ((0.20, 0.1471), (0.38, 0.2000))
        ]
        pieces.append(Piece("engine_rings", "nozzle", merge(stiffeners)))
    pods, jets = [], []
    for k in range(4):
        R = turn_z(np.pi / 4 + k * np.pi / 2)
        pod = box((0.772, -0.075, BODY_TOP_M - 0.15), (0.845, 0.075, BODY_TOP_M - 0.01), 0.006)
        pods.append(pod.rotated(R))
        group = [
            thruster((0.845, s * 0.045, z), (1, 0, 0), 0.019, 0.060, detail)
            for s in (-1, 1)
            for z in (BODY_TOP_M - 0.045,)
        ]
        group += [
            thruster((0.808, s * 0.045, BODY_TOP_M - 0.15), (0, 0, -1), 0.019, 0.060, detail) for s in (-1, 1)
        ]
        group.append(thruster((0.808, 0.0, BODY_TOP_M - 0.01), (0, 0, 1), 0.019, 0.060, detail))
        jets += [m.rotated(R) for m in group]
    return [
        *pieces,
        Piece("thruster_pods", "mli-silver", merge(pods)),
        Piece("thrusters", "nozzle", merge(jets)),
    ]


def _deck(detail: Detail) -> list[Piece]:
    """The sample port, three grips for the orbiter's claws, a cross target, reflectors, antennas, star trackers."""
    z = BODY_TOP_M
    port = cup((0, 0, z), (0, 0, 1), PORT_RADIUS_M, PORT_RADIUS_M - 0.025, PORT_TOP_M - z, 0.075, 64, detail)
    flange = tube(
        (0, 0, z + 0.004), (0, 0, 1), PORT_RADIUS_M + 0.045, PORT_RADIUS_M - 0.002, 0.018, 64, detail
    )
    hatch = cone((0, 0, z + 0.074), (0, 0, z + 0.086), 0.185, 0.175, facets(detail, 48))
    grips, feet = [], []
    n = facets(detail, 16)
    for k in range(3):
        R = turn_z(np.pi / 2 + k * 2 * np.pi / 3)
        r = GRIP_RADIUS_M
        nodes = [(r, -0.085, z), (r, -0.085, GRIP_TOP_M), (r, 0.085, GRIP_TOP_M), (r, 0.085, z)]
        grips.append(truss(np.array(nodes) @ R.T, [(0, 1), (1, 2), (2, 3)], 0.014, n))
        brace = [
            (r - 0.09, -0.085, z),
            (r, -0.085, GRIP_TOP_M - 0.02),
            (r - 0.09, 0.085, z),
            (r, 0.085, GRIP_TOP_M - 0.02),
        ]
        grips.append(truss(np.array(brace) @ R.T, [(0, 1), (2, 3)], 0.009, n))
        feet.append(box((r - 0.12, -0.115, z + 0.002), (r + 0.035, 0.115, z + 0.014)).rotated(R))
    target = [
        cone((-0.50, 0.0, z), (-0.50, 0.0, z + 0.020), 0.075, 0.075, facets(detail, 48)),
    ]
    cross = [
        box((-0.56, -0.006, z + 0.019), (-0.44, 0.006, z + 0.0225)),
        box((-0.506, -0.06, z + 0.019), (-0.494, 0.06, z + 0.0220)),
        rod((-0.50, 0, z + 0.02), (-0.50, 0, z + 0.075), 0.005, n),
    ]
    reflectors = [
        lathe(
            [(0, 0), (0.028, 0), (0.028, 0.03), (0.020, 0.036), (0, 0.036)],
            (x, y, z),
            (0, 0, 1),
            facets(detail, 24),
        )
        for x, y in ((0.56, 0.22), (0.56, -0.22), (-0.56, 0.24), (-0.56, -0.24), (0.30, 0.56), (0.30, -0.56))
    ]
    horn = cup((0.50, 0.0, z), (0, 0, 1), 0.060, 0.050, 0.13, 0.02, 32, detail)
    helix = cone((-0.30, 0.56, z), (-0.30, 0.56, z + 0.22), 0.030, 0.018, facets(detail, 24))
    pieces = [
        Piece("sample_port", "bare-aluminium", merge([port, flange])),
        Piece("sample_hatch", "white-paint", hatch),
        Piece("docking_grips", "titanium", merge(grips)),
        Piece("grip_feet", "bare-aluminium", merge(feet)),
        Piece("target_disc", "black-paint", merge(target)),
        Piece("target_cross", "white-paint", merge(cross)),
        Piece("reflectors", "radiator-mirror", merge(reflectors)),
        Piece("antennas", "white-paint", merge([horn, helix])),
    ]
    for k, (x, y, out) in enumerate(((-0.34, -0.58, (-0.35, -0.6, 0.72)), (-0.10, -0.60, (0.3, -0.65, 0.7)))):
        pieces += star_tracker(f"star_tracker_{k + 1}", (x, y, z), out, 0.065, 0.22, detail)
    return pieces


def _sides(detail: Detail) -> list[Piece]:
    """Radiators on +-x, electronics and a landing camera on +x, wing roots on +-y."""
    face = WIDTH_M / 2 - CORE_INSET_M
    radiator = box((face - 0.002, -0.32, 0.16), (face + 0.012, 0.32, 0.78))
    pieces = [Piece("radiators", "radiator-mirror", merge(both_sides(radiator, 0)))]
    if detail == "full":
        tiles = [
            box((face + 0.0115, y - 0.0015, 0.17), (face + 0.0135, y + 0.0015, 0.77))
            for y in np.linspace(-0.28, 0.28, 15)
        ]
        tiles += [
            box((face + 0.0115, -0.31, z - 0.0015), (face + 0.0131, 0.31, z + 0.0015))
            for z in np.linspace(0.2, 0.74, 14)
        ]
        pieces.append(
            Piece("radiator_joints", "grey-paint", merge([m for t in tiles for m in both_sides(t, 0)]))
        )
    boxes = [
        box((face, -0.30, 0.81), (face + 0.09, -0.10, 0.94), 0.004),
        box((face, 0.12, 0.82), (face + 0.07, 0.32, 0.93), 0.004),
    ]
    camera = cup((face + 0.085, -0.20, 0.875), (1, 0, 0), 0.040, 0.034, 0.07, 0.01, 32, detail)
    # a lamp-like antenna on the other side, after the omnidirectional ones in the pictures
    dish = cup((-face, 0.0, 0.875), (-1, 0, 0), 0.075, 0.067, 0.05, 0.01, 48, detail)
    mast = rod((-face - 0.005, 0.0, 0.875), (-face - 0.10, 0.0, 0.875), 0.006, facets(detail, 12))
    return [
        *pieces,
        Piece("electronics", "mli-silver", merge(boxes)),
        Piece("camera", "black-paint", camera),
        Piece("side_antenna", "white-paint", merge([dish, mast])),
    ]


def _wings(detail: Detail) -> list[Piece]:
    """Two sixteen-sided plates with cells above, each on a yoke."""
    plate = prism(wing_outline(), WING_PLATE_M, origin_m=(0, 0, WING_Z_M - WING_PLATE_M))
    rim_ring = wing_outline()
    inner = circle((0.0, WING_Y_M), WING_RADIUS_M - 0.020, WING_SIDES)
    rim = prism(rim_ring, 0.004, holes=[inner], origin_m=(0, 0, WING_Z_M))
    root = WIDTH_M / 2 - CORE_INSET_M
    inside = WING_Y_M - WING_RADIUS_M * np.cos(np.pi / WING_SIDES)
    yoke = [
        rod(
            (s * 0.13, root - 0.01, WING_Z_M - 0.02),
            (s * 0.13, inside + 0.06, WING_Z_M - 0.032),
            0.016,
            facets(detail, 16),
        )
        for s in (-1, 1)
    ]
    hinge = rod(
        (-0.20, root + 0.045, WING_Z_M - 0.022),
        (0.20, root + 0.045, WING_Z_M - 0.022),
        0.024,
        facets(detail, 20),
    )
    ribs = [
        box(
            (-0.62, WING_Y_M + y - 0.008, WING_Z_M - WING_PLATE_M - 0.020),
            (0.62, WING_Y_M + y + 0.008, WING_Z_M - WING_PLATE_M + 0.001),
        )
        for y in (-0.22, 0.22)
    ]
    pieces = [
        Piece("wing_plates", "kapton-substrate", merge(both_sides(plate, 1))),
        Piece("wing_rims", "bare-aluminium", merge(both_sides(rim, 1))),
        Piece("wing_cells", "solar-cell", merge(both_sides(_wing_cells(detail), 1))),
        Piece("wing_yokes", "bare-aluminium", merge([m for r in (*yoke, hinge) for m in both_sides(r, 1)])),
    ]
    if detail != "low":
        pieces.append(Piece("wing_ribs", "carbon-fibre", merge([m for r in ribs for m in both_sides(r, 1)])))
    return pieces


def _wing_cells(detail: Detail) -> Mesh:
    """Rows of cells that fit within the wing's rim; one plate at low detail."""
    reach = (WING_RADIUS_M - 0.026) * np.cos(np.pi / WING_SIDES)
    if detail == "low":
        return prism(
            circle((0.0, WING_Y_M), WING_RADIUS_M - 0.03, WING_SIDES), 0.0015, origin_m=(0, 0, WING_Z_M)
        )
    pitch = CELL_M if detail == "full" else (2 * CELL_M[0], 2 * CELL_M[1])
    w, h, clip = pitch[0] - 0.0015, pitch[1] - 0.0015, 0.006
    outline = (
        clipped_rectangle(w, h, clip, "all")
        if detail == "full"
        else rectangle((-w / 2, -h / 2), (w / 2, h / 2))
    )
    tile = prism(outline, 0.0015)
    count = (int(reach / pitch[0]) + 1, int(reach / pitch[1]) + 1)
    tiles = []
    for i, j in itertools.product(range(-count[0], count[0]), range(-count[1], count[1])):
        x, y = (i + 0.5) * pitch[0], (j + 0.5) * pitch[1]
        if np.hypot(abs(x) + w / 2, abs(y) + h / 2) < reach:
            tiles.append(tile.moved((x, WING_Y_M + y, WING_Z_M)))
    return merge(tiles)


def _keypoints() -> dict[str, Vec3]:
    names = ("px_py", "py_px", "py_nx", "nx_py", "nx_ny", "ny_nx", "ny_px", "px_ny")
    ring = octagon()
    order = np.argsort(np.arctan2(ring[:, 1], ring[:, 0]) % (2 * np.pi))
    points = {
        f"deck_{a}": (float(x), float(y), BODY_TOP_M) for a, (x, y) in zip(names, ring[order], strict=True)
    }
    points |= {f"base_{a}": (x, y, 0.0) for a, (x, y, _) in [(k[5:], p) for k, p in points.items()][::2]}
    out, side = WING_Y_M + WING_RADIUS_M, WING_RADIUS_M
    for b, sy in (("ny", -1), ("py", 1)):
        points[f"wing_{b}_tip"] = (0.0, sy * out, WING_Z_M + 0.004)
        points[f"wing_{b}_nx"] = (-side, sy * WING_Y_M, WING_Z_M + 0.004)
        points[f"wing_{b}_px"] = (side, sy * WING_Y_M, WING_Z_M + 0.004)
    exit_m = (0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M)
    points |= {
        f"nozzle_rim_{k}": rim_point(exit_m, (0, 0, -1), ENGINE_EXIT_M + ENGINE_WALL_M, k) for k in range(4)
    }
    points |= {f"port_rim_{k}": rim_point((0, 0, PORT_TOP_M), (0, 0, 1), PORT_RADIUS_M, k) for k in range(4)}
    return points


def _wireframe() -> list[Edge]:
    edges = prism_edges("deck_upper", octagon(), DECK_M, origin_m=(0, 0, BODY_TOP_M - DECK_M))
    edges += prism_edges("deck_lower", octagon(), DECK_M)
    exit_m = (0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M)
    edges += ring_edges("nozzle", exit_m, (0, 0, -1), ENGINE_EXIT_M + ENGINE_WALL_M, 64)
    edges += ring_edges("port", (0, 0, PORT_TOP_M), (0, 0, 1), PORT_RADIUS_M, 64)
    low, thick = WING_Z_M - WING_PLATE_M, WING_PLATE_M + 0.004
    outline = wing_outline()
    edges += prism_edges("wing_py", outline, thick, origin_m=(0, 0, low))
    edges += prism_edges("wing_ny", outline * (1, -1), thick, origin_m=(0, 0, low))
    return edges


def _occluders() -> list[Mesh]:
    wing = prism(wing_outline(), WING_PLATE_M, origin_m=(0, 0, WING_Z_M - WING_PLATE_M))
    tanks = [
        sphere((sx * TANK_XY_M, sy * TANK_XY_M, TANK_Z_M), TANK_RADIUS_M, 8, "full")
        for sx, sy in itertools.product((-1, 1), repeat=2)
    ]
    exit_z = ENGINE_TOP_M - ENGINE_LENGTH_M
    return [
        prism(octagon(CORE_INSET_M), BODY_TOP_M),
        *both_sides(wing, 1),
        *tanks,
        cone((0, 0, exit_z), (0, 0, 0.0), ENGINE_EXIT_M, 0.05, 6),
        cone((0, 0, BODY_TOP_M - 0.01), (0, 0, PORT_TOP_M), 0.23, 0.23, 6),
    ]


def _lumps() -> list[Lump]:
    """750 kg: propellant 460 and tanks 40 in four places, body 170, deck and docking 35, engine 20, wings 25."""
    lumps = [
        Lump(
            name="tank",
            mass_kg=125.0,
            centre_m=(sx * TANK_XY_M, sy * TANK_XY_M, TANK_Z_M),
            # a cube with a sphere's inertia: side = 2 r sqrt(3/5)
            size_m=vec3(np.full(3, 2 * TANK_RADIUS_M * 0.6**0.5)),
        )
        for sx, sy in itertools.product((-1, 1), repeat=2)
    ]
    lumps += [
        Lump(name="body", mass_kg=170.0, centre_m=(0, 0, 0.55), size_m=(1.4, 1.4, 0.95)),
        Lump(name="deck and docking", mass_kg=35.0, centre_m=(0, 0, BODY_TOP_M), size_m=(1.2, 1.2, 0.2)),
        Lump(name="engine", mass_kg=20.0, centre_m=(0, 0, -0.2), size_m=(0.3, 0.3, 0.5)),
    ]
    lumps += [
        Lump(name="wing", mass_kg=12.5, centre_m=(0, s * WING_Y_M, WING_Z_M), size_m=(1.24, 1.24, 0.02))
        for s in (-1, 1)
    ]
    return lumps
