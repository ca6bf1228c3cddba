"""Calibration from camera images of the patterns: map from screen to camera pixels, and response of the screen."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import PchipInterpolator

from flyaround.hil.corner_code import BLOCK_COLUMNS, BLOCK_ROWS, CodePlace
from flyaround.hil.display.patterns import LEVELS, PERIOD_PX, SHIFTS, half_period_bits
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.untrusted_files import read_regular, without_mark

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray

SCHEMA, VERSION = "flyaround.display", 1

# Limit of a calibration file, which has some 5 kB.
MAX_BYTES = 1 << 20

# Sides of a screen and of a camera image [px]: a Gray code has several bits on the smallest, OpenCV's maps hold the
# largest.
SCREEN_PX = (64, 16384)

# Degrees of the Chebyshev polynomials of the distortion, and of the brightness over the screen. A higher degree
# follows a sharper change, and amplifies noise at the border.
GEOMETRY_DEGREE = 7
SHADING_DEGREE = 4

MIN_MODULATION = 0.1
"""Minimum modulation of the fringes relative to white at which a pixel is used."""

# Maximum number of measured points in the fits, for speed. Two polynomials of degree 7 have 128 coefficients.
MAX_POINTS = 60_000

# Distance from the fitted map above which a point is an outlier [standard deviations]. Of normal errors one in 16,000
# is beyond it.
OUTLIER_SIGMAS = 4.0

# Percentile of white over the screen that is white after shading correction: brighter pixels can be dimmed to it, but
# darker ones cannot be brightened.
DARKEST_PERCENTILE = 1.0

# Modulation and white are compared with this percentile of the image, beyond single hot pixels and reflections.
WHITE_PERCENTILE = 99.0

# Pixels of the camera per coefficient of a fit, below which the screen counts as not found.
PIXELS_PER_COEFFICIENT = 10

# Reprojection error of RANSAC [px], above what a lens bends, and factor over the median residual beyond which a point
# is none of the screen's: the lens bends by as much as the median, reflections are far outside of it.
RANSAC_PX, REFLECTION_FACTOR = 20.0, 50.0

# Number of fits: each leaves out what the one before showed to be outliers.
FITS = 3

# Cell size of the frame code in the camera's image [px].
CODE_CELL_PX = 8


class DisplayCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """Geometric and radiometric relation between a screen and the camera that views it.

    Parameters
    ----------
    screen_px : tuple of int
        Width and height of the screen.
    camera_px : tuple of int
        Width and height of the camera image.
    homography : list of float
        Homography, 3 x 3 row by row, from screen to camera pixels; pixel (0, 0) is the centre of the first one.
    bend : list of list of list of float
        Chebyshev coefficients, 8 x 8 for x and for y, of the residual [px] over the screen mapped to -1..1.
    shading : list of list of float
        Chebyshev coefficients, 5 x 5, of the brightness of level 255 over the screen [DN of the camera].
    levels : list of int
        Grey levels of the screen at which the response was measured.
    response : list of float
        Relative brightness of each of ``levels``, from 0 at level 0 to 1 at 255.
    black_dn : float
        Digital number of the camera at level 0.
    white_dn : float
        Digital number of white after shading correction.
    code_left_px : int
        Left edge of the frame code in the camera's image.
    code_top_px : int
        Upper edge of the frame code.
    code_cell_px : int
        Cell size of the frame code.
    geometry_rms_px : float
        RMS distance of the measured points from the fitted map.
    schema : str, optional
        Name of the format.
    version : int, optional
        Version of the format.

    Raises
    ------
    ValueError
        If a number is not finite, a table has another shape, or a size, a level or a brightness is impossible.
    """

    screen_px: tuple[int, int]
    camera_px: tuple[int, int]
    homography: list[float]
    bend: list[list[list[float]]]
    shading: list[list[float]]
    levels: list[int]
    response: list[float]
    black_dn: float
    white_dn: float
    code_left_px: int
    code_top_px: int
    code_cell_px: int
    geometry_rms_px: float
    schema: str = SCHEMA
    version: int = VERSION

    def __post_init__(self) -> None:
        """Check that the numbers describe a screen and a camera."""
        for name in ("screen_px", "camera_px"):
            if not all(SCREEN_PX[0] <= side <= SCREEN_PX[1] for side in getattr(self, name)):
                raise ValueError(
                    f"{name} is {getattr(self, name)}, allowed: sides of {SCREEN_PX[0]} to {SCREEN_PX[1]}"
                )
        if len(self.levels) < 2 or not all(
            a < b for a, b in zip(self.levels[:-1], self.levels[1:], strict=True)
        ):
            raise ValueError("levels must increase")
        shapes = {
            "homography": (9,),
            "bend": (2, GEOMETRY_DEGREE + 1, GEOMETRY_DEGREE + 1),
            "shading": (SHADING_DEGREE + 1, SHADING_DEGREE + 1),
            "response": (len(self.levels),),
        }
        for name, shape in shapes.items():
            table = getattr(self, name)
            if not _has_shape(table, shape) or not np.isfinite(np.array(table)).all():
                raise ValueError(f"{name} must have finite numbers of shape {shape}")
        if not (isfinite(self.black_dn) and 0 < self.white_dn < np.inf):
            raise ValueError(
                f"white_dn is {self.white_dn:g} above {self.black_dn:g}, it must be finite and positive"
            )
        if self.code_cell_px < 1 or min(self.code_left_px, self.code_top_px) < 0:
            raise ValueError("code_cell_px must be at least 1, code_left_px and code_top_px not negative")

    @property
    def code_place(self) -> CodePlace:
        """Position of the frame code in the camera's image."""
        return CodePlace(self.code_left_px, self.code_top_px, self.code_cell_px)

    def camera_from_screen(self, screen_xy_px: FloatArray) -> FloatArray:
        """Map screen pixels (N, 2) to camera pixels (N, 2)."""
        flat = np.asarray(self.homography, float).reshape(3, 3)
        points = np.column_stack((screen_xy_px, np.ones(len(screen_xy_px)))) @ flat.T
        straight = points[:, :2] / points[:, 2:]
        unit = _unit(screen_xy_px, self.screen_px)
        bend = [chebyshev.chebval2d(unit[:, 0], unit[:, 1], np.asarray(axis)) for axis in self.bend]
        return np.asarray(straight + np.column_stack(bend))

    def screen_light_dn(self, screen_xy_px: FloatArray) -> FloatArray:
        """Return the brightness (N,) of level 255 at screen pixels, as the camera sees it [DN]."""
        unit = _unit(screen_xy_px, self.screen_px)
        return np.asarray(chebyshev.chebval2d(unit[:, 0], unit[:, 1], np.asarray(self.shading)))

    def levels_for(self, light: FloatArray) -> FloatArray:
        """Return the unrounded screen levels for brightnesses relative to level 255."""
        fine = np.arange(256.0)
        response = PchipInterpolator(np.asarray(self.levels, float), np.asarray(self.response))(fine)
        return np.asarray(np.interp(light, np.maximum.accumulate(response), fine))


def _has_shape(table: object, shape: tuple[int, ...]) -> bool:
    """Return True if nested lists have the lengths of ``shape``."""
    if not shape:
        return not isinstance(table, list)
    return isinstance(table, list) and len(table) == shape[0] and all(_has_shape(t, shape[1:]) for t in table)


def write_calibration(calibration: DisplayCalibration, path: Path) -> None:
    """Write a calibration as JSON."""
    write_atomic(path, msgspec.json.format(msgspec.json.encode(calibration), indent=1))


def read_calibration(path: Path) -> DisplayCalibration:
    """Read a calibration from a file.

    Returns
    -------
    DisplayCalibration
        Relation between the screen and the camera.

    Raises
    ------
    UserError
        If the file is not a calibration of this version.
    """
    try:
        data = without_mark(read_regular(path, MAX_BYTES), str(path))
        calibration = msgspec.json.decode(data, type=DisplayCalibration)
    except (OSError, msgspec.MsgspecError) as error:
        raise UserError(
            f"{path} is not a calibration written by flyaround hil display-calibrate: {error}"
        ) from error
    if (calibration.schema, calibration.version) != (SCHEMA, VERSION):
        raise UserError(
            f"{path} is {calibration.schema} version {calibration.version}, expected {SCHEMA} version {VERSION}"
        )
    return calibration


def calibrate(grabs: Mapping[str, FloatArray], screen_px: tuple[int, int]) -> DisplayCalibration:
    """Calibrate from the camera's images of `calibration_patterns`.

    Parameters
    ----------
    grabs : mapping of str to array
        Digital numbers (H, W) of a camera without gamma, by pattern name, averaged over repeated images.
    screen_px : tuple of int
        Width and height of the screen.

    Returns
    -------
    DisplayCalibration
        Map from screen to camera pixels, and response of the screen.

    Raises
    ------
    UserError
        If an image is missing or has another size, or the screen cannot be found in them.
    """
    patterns = [f"level_{level:03}" for level in LEVELS]
    patterns += [f"{axis}_phase_{k}" for axis in "xy" for k in range(SHIFTS)]
    missing = [name for name in patterns if name not in grabs]
    if missing:
        raise UserError(f"no picture of {missing[0]}: grab every pattern that hil display --patterns shows")
    dark, bright = grabs["level_000"], grabs["level_255"]
    other = next((name for name, grab in grabs.items() if grab.shape != dark.shape), None)
    if other is not None:
        sizes = [
            f"{name} is {grabs[name].shape[1]} x {grabs[name].shape[0]} pixels"
            for name in (other, "level_000")
        ]
        raise UserError(f"{', '.join(sizes)}: grab every pattern with the same camera settings")
    swing = bright - dark
    phases = {
        axis: _decode(grabs, axis, size, dark, swing) for axis, size in zip("xy", screen_px, strict=True)
    }
    valid = np.isfinite(phases["x"]) & np.isfinite(phases["y"])
    if np.count_nonzero(valid) < (GEOMETRY_DEGREE + 1) ** 2 * PIXELS_PER_COEFFICIENT:
        raise UserError(
            "the screen is not found in the pictures: let it fill most of the camera's view, in focus, at an exposure "
            "at which white is not saturated"
        )
    rows, columns = np.nonzero(valid)
    step = max(1, len(rows) // MAX_POINTS)
    rows, columns = rows[::step], columns[::step]
    camera = np.column_stack((columns, rows)).astype(float)
    screen = np.column_stack((phases["x"][rows, columns], phases["y"][rows, columns]))
    flat, bend, rms, inliers = _fit_map(screen, camera, screen_px)
    shading = _fit_surface(_unit(screen[inliers], screen_px), swing[rows, columns][inliers], SHADING_DEGREE)
    response = [float(np.median((grabs[f"level_{g:03}"] - dark)[valid] / swing[valid])) for g in LEVELS]
    height_px, width_px = dark.shape
    draft = DisplayCalibration(
        screen_px=screen_px,
        camera_px=(width_px, height_px),
        homography=[float(x) for x in flat.ravel()],
        bend=[axis.tolist() for axis in bend],
        shading=shading.tolist(),
        levels=list(LEVELS),
        response=[float(x) for x in np.maximum.accumulate(response)],
        black_dn=float(np.median(dark[valid])),
        white_dn=float(np.percentile(swing[valid], DARKEST_PERCENTILE)),
        code_left_px=0,
        code_top_px=0,
        code_cell_px=CODE_CELL_PX,
        geometry_rms_px=rms,
    )
    left, top = _code_corner(valid)
    return msgspec.structs.replace(draft, code_left_px=left, code_top_px=top)


def _decode(
    grabs: Mapping[str, FloatArray], axis: str, size_px: int, dark: FloatArray, swing: FloatArray
) -> FloatArray:
    """Return the screen coordinate (H, W) along an axis seen by each camera pixel [px]; NaN where there is none."""
    angles = 2 * np.pi * np.arange(SHIFTS) / SHIFTS
    shifted = [grabs[f"{axis}_phase_{k}"] for k in range(SHIFTS)]
    sine = sum(np.sin(a) * g for a, g in zip(angles, shifted, strict=True))
    cosine = sum(np.cos(a) * g for a, g in zip(angles, shifted, strict=True))
    phase = np.arctan2(sine, cosine) % (2 * np.pi)
    half = np.zeros(dark.shape, int)
    above = np.zeros(dark.shape, int)
    for bit in reversed(range(half_period_bits(size_px))):
        name = f"{axis}_code_{bit}"
        if name not in grabs:
            raise UserError(f"no picture of {name}: grab every pattern that hil display --patterns shows")
        above = ((grabs[name] - dark) > swing / 2).astype(int) ^ above
        half |= above << bit
    # the Gray code may be wrong by one near the border of half periods, where the phase is near 0 or 2 pi and decides
    near_start, near_end = phase < np.pi / 2, phase > 3 * np.pi / 2
    period = np.where(near_start, (half + 1) // 2, np.where(near_end, (half + 1) // 2 - 1, half // 2))
    position = (period + phase / (2 * np.pi)) * PERIOD_PX
    modulation = np.hypot(sine, cosine) * 2 / SHIFTS
    is_lit = (swing > MIN_MODULATION * np.percentile(swing, WHITE_PERCENTILE)) & (
        modulation > MIN_MODULATION * swing
    )
    inside = (position > -1) & (position < size_px)
    return np.where(is_lit & inside, position, np.nan)


def _fit_map(
    screen: FloatArray, camera: FloatArray, screen_px: tuple[int, int]
) -> tuple[FloatArray, list[FloatArray], float, FloatArray]:
    """Fit homography and distortion from screen to camera; return them with their RMS [px] and the inliers."""
    homography, _ = cv2.findHomography(screen, camera, cv2.RANSAC, RANSAC_PX)
    if homography is None:
        raise UserError("the pictures of the fringes do not show a flat screen")
    flat = np.asarray(homography, float)
    points = np.column_stack((screen, np.ones(len(screen)))) @ flat.T
    left_over = camera - points[:, :2] / points[:, 2:]
    unit = _unit(screen, screen_px)
    residual = np.hypot(*left_over.T)
    inliers = residual < REFLECTION_FACTOR * max(1.0, float(np.median(residual)))
    bend: list[FloatArray] = []
    rms = 0.0
    for _ in range(FITS):
        bend = [_fit_surface(unit[inliers], left_over[inliers, i], GEOMETRY_DEGREE) for i in range(2)]
        error = np.column_stack(
            [left_over[:, i] - chebyshev.chebval2d(unit[:, 0], unit[:, 1], bend[i]) for i in range(2)]
        )
        distance = np.hypot(*error.T)
        rms = float(np.sqrt(np.mean(distance[inliers] ** 2)))
        inliers = distance < max(OUTLIER_SIGMAS * rms, 1e-9)
    return flat, bend, rms, inliers


def _fit_surface(unit: FloatArray, values: FloatArray, degree: int) -> FloatArray:
    """Fit Chebyshev coefficients (degree + 1, degree + 1) by least squares."""
    basis = chebyshev.chebvander2d(unit[:, 0], unit[:, 1], [degree, degree])
    solution = np.linalg.lstsq(basis, values, rcond=None)[0]
    return np.asarray(solution.reshape(degree + 1, degree + 1))


def _unit(screen_xy_px: FloatArray, screen_px: tuple[int, int]) -> FloatArray:
    """Return screen pixels scaled to -1..1 along both axes."""
    size = np.asarray(screen_px, float)
    return np.asarray(2 * screen_xy_px / (size - 1) - 1)


def _code_corner(valid: BoolArray) -> tuple[int, int]:
    """Return the column and row for the frame code: on the screen, near its upper left corner."""
    width, height = BLOCK_COLUMNS * CODE_CELL_PX, BLOCK_ROWS * CODE_CELL_PX
    solid = cv2.morphologyEx(np.asarray(valid, np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    eroded = cv2.erode(
        solid,
        np.ones((height, width), np.uint8),
        anchor=(0, 0),
        borderType=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    rows, columns = np.nonzero(eroded)
    if len(rows) == 0:
        raise UserError("the screen is too small in the camera's view to hold the frame's code")
    first = int(np.argmin(rows + columns))
    return int(columns[first]), int(rows[first])
