"""The camera's sections of a scenario file: changes to a detector and to a perfect lens."""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import cv2
import msgspec
import numpy as np
from msgspec import Meta

from flyaround.simulator.camera.detector.limits import DETECTOR, MAX_KERNEL_SIZE, OPTICS
from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.sections import Section, within
from flyaround.simulator.runtime.untrusted_files import decode_text, read_regular

# Size limit of a kernel's file [bytes], which bounds the time to parse it; a kernel itself has at most 63 x 63 numbers.
MAX_KERNEL_BYTES = 1_000_000

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.response import Curve

_Share = Annotated[float, Meta(ge=0, le=1)]
_CurvePoint = tuple[Annotated[float, within(OPTICS["wavelength_m"], 1e9)], _Share]


class DetectorSection(Section, frozen=True, kw_only=True):
    """Keys of `[sensor.detector]`: the changed parameters of the detector.

    ``quantum_efficiency_curve`` is a list of [wavelength in nm, electrons per photon], ascending; it replaces
    ``quantum_efficiency``.
    """

    quantum_efficiency: list[Annotated[float, Meta(gt=0, le=1)]] | None = None
    quantum_efficiency_curve: list[_CurvePoint] | None = None
    full_well_e: Annotated[float, within(DETECTOR["full_well_e"])] | None = None
    gain_e_per_dn: Annotated[float, within(DETECTOR["gain_e_per_dn"])] | None = None
    black_level_dn: Annotated[float, within(DETECTOR["black_level_dn"])] | None = None
    read_noise_e: Annotated[float, within(DETECTOR["read_noise_e"])] | None = None
    row_noise_e: Annotated[float, within(DETECTOR["row_noise_e"])] | None = None
    column_noise_e: Annotated[float, within(DETECTOR["column_noise_e"])] | None = None
    dark_current_e_s: Annotated[float, within(DETECTOR["dark_current_e_s"])] | None = None
    dark_reference_c: Annotated[float, within(DETECTOR["dark_reference_c"])] | None = None
    dark_doubling_c: Annotated[float, within(DETECTOR["dark_doubling_c"])] | None = None
    temperature_c: Annotated[float, within(DETECTOR["temperature_c"])] | None = None
    dsnu_e: Annotated[float, within(DETECTOR["dsnu_e"])] | None = None
    dark_nonuniformity: Annotated[float, within(DETECTOR["dark_nonuniformity"])] | None = None
    prnu: Annotated[float, within(DETECTOR["prnu"])] | None = None
    hot_pixel_share: Annotated[float, within(DETECTOR["hot_pixel_share"])] | None = None
    hot_pixel_e_s: Annotated[float, within(DETECTOR["hot_pixel_e_s"])] | None = None
    dead_pixel_share: Annotated[float, within(DETECTOR["dead_pixel_share"])] | None = None
    blooming: Annotated[float, within(DETECTOR["blooming"])] | None = None
    cosmic_rays_cm2_s: Annotated[float, within(DETECTOR["cosmic_rays_cm2_s"])] | None = None
    layer_um: Annotated[float, within(DETECTOR["layer_m"], 1e6)] | None = None
    colour_filter: Literal["none", "rggb", "bggr", "grbg", "gbrg"] | None = None
    demosaic: bool | None = None
    charge_binning: bool | None = None
    serial: Annotated[int, within(DETECTOR["serial"])] | None = None

    def detector(self, base: Detector | None) -> Detector:
        """Return a detector with the changes of this section.

        Returns
        -------
        Detector
            Copy of ``base``, or of the default detector if that is None, with the keys that are set; lengths in metres.
        """
        changes = {k: v for k, v in msgspec.structs.asdict(self).items() if v is not None}
        if "layer_um" in changes:
            changes["layer_m"] = changes.pop("layer_um") * 1e-6
        if "quantum_efficiency" in changes:
            changes["quantum_efficiency"] = tuple(changes["quantum_efficiency"])
            # drop the preset's curve: the given number replaces it
            changes.setdefault("quantum_efficiency_curve", ())
        if "quantum_efficiency_curve" in changes:
            changes["quantum_efficiency_curve"] = _in_metres(changes["quantum_efficiency_curve"])
        return replace(base or Detector(), **changes)


class OpticsSection(Section, frozen=True, kw_only=True):
    """Section `[optics]`: the lens apart from its distortion.

    ``kernel_file`` names a measured PSF next to the scenario: a .npy, text with one row of numbers per line, or a grey
    image (.png, .tif) with its black level subtracted, which is normalised. ``transmission_curve`` is a list of
    [wavelength in nm, share], ascending: a filter that multiplies ``transmission``. ``wavelength_nm`` affects
    diffraction only.
    """

    f_number: Annotated[float, within(OPTICS["f_number"])] = 4.0
    transmission: Annotated[float, within(OPTICS["transmission"])] = 1.0
    transmission_curve: list[_CurvePoint] = msgspec.field(default_factory=list)
    wavelength_nm: Annotated[float, within(OPTICS["wavelength_m"], 1e9)] = 550.0
    psf: Literal["none", "gaussian", "airy", "kernel"] = "none"
    psf_sigma_px: Annotated[float, within(OPTICS["psf_sigma_px"])] = 0.0
    kernel: list[list[float]] = msgspec.field(default_factory=list)
    kernel_file: str = ""
    defocus: bool = False
    focus_distance_m: Annotated[float, within(OPTICS["focus_distance_m"])] = 0.0
    natural_vignetting: bool = False
    mechanical_vignetting: Annotated[float, within(OPTICS["mechanical_vignetting"])] = 0.0
    rim_radius: Annotated[float, within(OPTICS["rim_radius"])] = 1.2
    glow_share: Annotated[float, within(OPTICS["glow_share"])] = 0.0
    glow_radius_px: Annotated[float, within(OPTICS["glow_radius_px"])] = 20.0
    scatter_share: Annotated[float, within(OPTICS["scatter_share"])] = 0.0
    veiling_glare_sr: Annotated[float, within(OPTICS["veiling_glare_sr"])] = 0.0
    glare_limit_deg: Annotated[float, within(OPTICS["glare_limit_deg"])] = 60.0

    def optics(self) -> Optics:
        """Return the optics that this section describes.

        Returns
        -------
        Optics
            Optics in SI units; the kernel is that of ``kernel``, and ``kernel_file`` is not read.
        """
        keys = msgspec.structs.asdict(self)
        del keys["kernel_file"]
        keys["wavelength_m"] = keys.pop("wavelength_nm") * 1e-9
        keys["transmission_curve"] = _in_metres(self.transmission_curve)
        keys["kernel"] = tuple(tuple(row) for row in self.kernel)
        return Optics(**keys)

    def with_kernel(self, folder: Path, source: str) -> OpticsSection:
        """Return the section with its kernel file read.

        Returns
        -------
        OpticsSection
            Copy with the table in ``kernel`` and an empty ``kernel_file``; the section itself if it names no file.

        Raises
        ------
        UserError
            If the file is missing or no table of numbers.
        """
        if not self.kernel_file:
            return self
        path = folder / self.kernel_file
        try:
            table = _read_kernel(path)
            if table.dtype.kind not in "fiu":
                raise ValueError(f"it holds values of type {table.dtype}")
        except (
            UserError,
            OSError,
            ValueError,
            EOFError,
            MemoryError,
            TypeError,
            SyntaxError,
            cv2.error,
        ) as error:
            raise UserError(
                f"{source}: key optics.kernel_file: {path} cannot be read as a table of numbers ({error})"
            ) from error
        if table.ndim != 2:
            raise UserError(f"{source}: key optics.kernel_file: {path} has {table.ndim} axes, a PSF has two")
        return msgspec.structs.replace(self, kernel=table.astype(float).tolist(), kernel_file="")


def _in_metres(curve_nm: Sequence[tuple[float, float]]) -> Curve:
    return tuple((wavelength_nm * 1e-9, share) for wavelength_nm, share in curve_nm)


def _read_kernel(path: Path) -> NDArray[Any]:
    """Read a kernel file; an image is divided by its sum."""
    data = read_regular(path, MAX_KERNEL_BYTES)
    if path.suffix == ".npy":
        return np.asarray(np.load(io.BytesIO(data), allow_pickle=False))
    if path.suffix in {".png", ".tif", ".tiff"}:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if picture is None:
            raise ValueError("it is not a readable image")
        if max(picture.shape) > MAX_KERNEL_SIZE:
            raise ValueError(
                f"it has {picture.shape[1]} x {picture.shape[0]} pixels, at most {MAX_KERNEL_SIZE} a side"
            )
        if picture.ndim == 2 and picture.max() == 0:
            raise ValueError("it is black all over")
        return picture / picture.sum(dtype=float)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # an empty file is detected by its shape
        return np.loadtxt(io.StringIO(decode_text(data, str(path))), delimiter=_delimiter(path), ndmin=2)


def _delimiter(path: Path) -> str | None:
    return "," if path.suffix == ".csv" else None


def crop_and_bin(
    camera: Camera, roi_px: tuple[int, int, int, int] | None, binning: int, source: str
) -> Camera:
    """Return the camera of a detector region, with ``binning`` by ``binning`` pixels combined into one.

    Parameters
    ----------
    camera : Camera
        Camera of the whole detector.
    roi_px : tuple of int or None
        x0, y0, width, height in pixels of the whole image, or None for the whole image.
    binning : int
        Width and height of a bin.
    source : str
        Name of the scenario, for messages.

    Returns
    -------
    Camera
        Intrinsics of the smaller image.

    Raises
    ------
    UserError
        If the region is not inside the image or does not hold whole bins.
    """
    x0, y0, width, height = roi_px or (0, 0, camera.width_px, camera.height_px)
    if x0 < 0 or y0 < 0 or x0 + width > camera.width_px or y0 + height > camera.height_px:
        raise UserError(
            f"{source}: key sensor.roi_px is {[x0, y0, width, height]}, allowed: x0, y0, width, height inside the "
            f"camera's {camera.width_px} x {camera.height_px} pixels"
        )
    # 16 pixels: the smallest image of `Camera`
    if width % binning or height % binning or min(width, height) < 16 * binning:
        raise UserError(
            f"{source}: key sensor.binning is {binning}, allowed: a divisor of {width} x {height} that leaves 16 pixels"
        )
    # the centre of a bin is (b - 1) / 2 pixels from that of its first pixel
    return replace(
        camera,
        width_px=width // binning,
        height_px=height // binning,
        fx_px=camera.fx_px / binning,
        fy_px=camera.fy_px / binning,
        cx_px=(camera.cx_px - x0 + 0.5) / binning - 0.5,
        cy_px=(camera.cy_px - y0 + 0.5) / binning - 0.5,
    )


def sensor_region(sensor: Sensor, roi_px: tuple[int, int, int, int] | None, binning: int) -> Sensor:
    """Return the sensor of a detector region: binned pixels, and the region's part of the fixed pattern.

    Parameters
    ----------
    sensor : Sensor
        Sensor of the whole detector.
    roi_px : tuple of int or None
        x0, y0, width, height in pixels of the whole image, or None for the whole image.
    binning : int
        Width and height of a bin.

    Returns
    -------
    Sensor
        Sensor of the smaller image.
    """
    x0, y0 = (roi_px or (0, 0))[:2]
    detector = sensor.detector
    if detector is not None:
        detector = replace(detector, binning=binning, roi_x0_px=x0, roi_y0_px=y0)
    return replace(
        sensor,
        pixel_pitch_x_m=sensor.pixel_pitch_x_m * binning,
        pixel_pitch_y_m=sensor.pixel_pitch_y_m * binning,
        detector=detector,
    )
