"""Measurement of the simulated camera: ``python -m tools.validation.camera`` writes the page.

It has a calibration by OpenCV from images of a chessboard, the detector by EMVA 1288, photon noise by chi-square tests,
and the transfer function from a slanted edge.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.presets import list_sensor_presets, sensor_preset
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from tools.validation.camera.calibration import LENSES, calibrate
from tools.validation.camera.counts import electron_chance, reading_chance
from tools.validation.camera.emva1288 import READOUT_MODES, measure, measure_colours, without_nonuniformity
from tools.validation.camera.mtf import CASES, FREQUENCIES, compare, drawn_edge

if TYPE_CHECKING:
    from collections.abc import Callable


PAGE = Path("docs/validation/camera.md")
GOALS = {"system gain [DN/e]": 0.01, "read noise [e]": 0.03}  # maximum relative errors
OTHER_GOAL = 0.03  # maximum relative error of the other quantities
COLOUR_GOAL = 0.02  # maximum relative error
MTF_GOAL = 0.02  # maximum difference of contrast
RMS_GOAL_PX = 0.05  # maximum reprojection error
SIGMAS_GOAL = 3.0  # maximum error of a parameter in its own sigmas
CHANCE_GOAL = 1e-3  # minimum p-value
CALIBRATION_NOTE = (
    "Twenty pictures of the chessboard (recipe `calibration-chessboard`, 800 x 600, blur 0.7 px, 8 bits, noise of "
    "half a digital number), corners by `findChessboardCorners` and `cornerSubPix`, lens by "
    "`calibrateCameraExtended` and `fisheye.calibrate`. Goals: every parameter within "
    f"{SIGMAS_GOAL:g} of the calibration's own sigmas (for the fisheye, which reports none, from the Jacobian at its "
    f"solution), reprojection rms at most {RMS_GOAL_PX} px."
)
DETECTOR_NOTE = (
    "By EMVA 1288, from flat and dark pictures alone: photon transfer from pairs at 15 levels, spatial variances of "
    "40 pictures at half saturation and in the dark, dark signal over exposure times. Goals: gain 1 %, the rest 3 %."
)
COLOUR_NOTE = (
    'The same detectors with `colour_filter`, and `bands = "rgb"`: electrons of each channel per digital number of the '
    "picture, from photon transfer of a white plate in sunlight. White balance multiplies digital numbers above the "
    "black level, so that a number of a balanced channel is fewer electrons; a raw mosaic is not balanced. "
    "Interpolation averages neighbours: what is measured there is the mean over the electrons collected, as its noise "
    f"is no longer that of single pixels. Goal: {100 * COLOUR_GOAL:g} %."
)
TRANSFER_NOTE = (
    "Modulation transfer function from the drawn edge of a plate, 5 degrees off the columns (ISO 12233), beside that "
    f"of the PSF times the pixel's, 0.05 to 0.45 cycles per pixel. Goal: within {MTF_GOAL} of full contrast. A PSF "
    "much narrower than 0.7 px cannot be represented on whole pixels without negative light: its kernel is the "
    "nearest one."
)
COUNT_NOTE = (
    "1e5 drawn counts against the Poisson law; 1e5 digital numbers of each detector, its pixels made equal, against "
    "that of photons, full well, read noise and converter, from the dark to beyond saturation. Bins expect 20. "
    f"Goal: p above {CHANCE_GOAL:g}."
)
MEANS_E = (0.5, 3.0, 30.0, 3000.0)  # means of the Poisson distributions [e]
SHARES = (0.0, 0.001, 0.1, 0.9, 1.0, 1.1)  # mean signal as a share of saturation

Section = tuple[list[str], bool]


def _verdict(met: bool) -> str:  # noqa: FBT001 - a verdict is what it says
    return "met" if met else "**missed**"


def _detectors() -> list[str]:
    return [name for name in list_sensor_presets() if sensor_preset(name).detector is not None]


def calibration(renderer: Renderer, seed: int) -> Section:
    """Return the calibration of each lens from twenty images of the chessboard."""
    lines = [
        "## Calibration",
        "",
        CALIBRATION_NOTE,
    ]
    good = True
    for lens in LENSES:
        result = calibrate(renderer, lens, seed=seed)
        worst = float(np.abs(result.deviation).max())
        met = worst <= SIGMAS_GOAL and result.rms_px <= RMS_GOAL_PX
        good &= met
        lines += [
            "",
            (
                f"**{lens}**: {result.corners} corners, rms {result.rms_px:.3f} px, "
                f"worst {worst:.1f} sigma: {_verdict(met)}."
            ),
            "",
            "| parameter | true | found | sigma | error / sigma |",
            "|---|---|---|---|---|",
        ]
        table = zip(result.names, result.true, result.found, result.sigma, result.deviation, strict=True)
        lines += [f"| {n} | {t:.6g} | {f:.6g} | {s:.2g} | {d:+.2f} |" for n, t, f, s, d in table]
    return lines, good


def detector(seed: int) -> Section:
    """Return the characteristics of built-in detectors by EMVA 1288."""
    lines = [
        "## Detector",
        "",
        DETECTOR_NOTE,
        "",
        "| detector | quantity | given | measured | error | |",
        "|---|---|---|---|---|---|",
    ]
    good = True
    for preset in _detectors():
        for m in measure(preset, seed=seed):
            met = abs(m.error) <= GOALS.get(m.name, OTHER_GOAL)
            good &= met
            lines.append(
                f"| {preset} | {m.name} | {m.given:.4g} | {m.found:.4g} | {100 * m.error:+.2f} % | {_verdict(met)} |"
            )
    lines += [
        "",
        "### Colour channels",
        "",
        COLOUR_NOTE,
        "",
        "| detector | picture | e/DN red | green | blue | measured red | green | blue | largest error | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for preset in _detectors():
        for mode in READOUT_MODES:
            results = measure_colours(preset, mode=mode, seed=seed)
            worst = max(abs(m.error) for m in results)
            good &= worst <= COLOUR_GOAL
            cells = [f"{1 / m.given:.3f}" for m in results] + [f"{1 / m.found:.3f}" for m in results]
            lines.append(
                f"| {preset} | {mode} | {' | '.join(cells)} | {100 * worst:.2f} % | {_verdict(worst <= COLOUR_GOAL)} |"
            )
    return lines, good


def photons(seed: int) -> Section:
    """Compare electron counts with the Poisson distribution, and digital numbers with the detector's distribution."""
    lines = [
        "## Photon noise",
        "",
        COUNT_NOTE,
        "",
        "| drawn | mean [e] | chi-square | degrees of freedom | p | |",
        "|---|---|---|---|---|---|",
    ]
    good = True

    def add(quantity: str, mean_e: float, outcome: tuple[float, int, float]) -> None:
        nonlocal good
        statistic, freedom, p = outcome
        good &= p > CHANCE_GOAL
        lines.append(
            f"| {quantity} | {mean_e:g} | {statistic:.1f} | {freedom} | {p:.2g} | {_verdict(p > CHANCE_GOAL)} |"
        )

    for mean_e in MEANS_E:
        add("electrons", mean_e, electron_chance(mean_e, seed=seed))
    for preset in _detectors():
        sensor = without_nonuniformity(sensor_preset(preset))
        for share in SHARES:
            mean_e = float(np.round(share * sensor.saturation_e))
            add(f"{preset}, digital numbers", mean_e, reading_chance(sensor, mean_e, seed=seed))
    return lines, good


def transfer(renderer: Renderer) -> Section:
    """Return the transfer function from a rendered slanted edge."""
    lines = [
        "## Sharpness",
        "",
        TRANSFER_NOTE,
        "",
        "| PSF | at 0.1 | at 0.25 | at 0.4 | preset `default`: largest difference | `high` | |",
        "|---|---|---|---|---|---|---|",
    ]
    good = True
    columns = [int(np.argmin(np.abs(FREQUENCIES - f))) for f in (0.1, 0.25, 0.4)]
    coarse, fine = (drawn_edge(renderer, quality) for quality in ("default", "high"))
    for case in CASES:
        quick, ideal, _ = compare(case, coarse)
        measured, _, _ = compare(case, fine)
        worst_quick, worst = (float(np.abs(m - ideal).max()) for m in (quick, measured))
        good &= max(worst, worst_quick) <= MTF_GOAL
        cells = " | ".join(f"{measured[k]:.3f} ({ideal[k]:.3f})" for k in columns)
        verdict = _verdict(max(worst, worst_quick) <= MTF_GOAL)
        lines.append(f"| {case} | {cells} | {worst_quick:.4f} | {worst:.4f} | {verdict} |")
    return lines, good


def main(arguments: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Measure, print and write the page; return 0 if every goal is met."""
    parser = argparse.ArgumentParser(description="Measure the simulated camera.")
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="page to write")
    parser.add_argument("--seed", type=int, default=1, help="seed of all random numbers")
    options = parser.parse_args(arguments)
    with Renderer() as renderer:
        first, good = calibration(renderer, options.seed)
        more, met = transfer(renderer)
        driver = renderer.info.renderer
    lines = [
        "# The camera, measured",
        "",
        f"Made by `python -m tools.validation.camera` with {driver}, seed {options.seed}.",
        "",
        *first,
        "",
        *more,
    ]
    for part in (detector, photons):
        more, also_met = part(options.seed)
        met &= also_met
        lines += ["", *more]
    good &= met
    text = "\n".join(lines) + "\n"
    write_atomic(options.output, text.encode())
    say(text)
    return 0 if good else 1
