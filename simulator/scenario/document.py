"""Sections and properties that scenario and recipe files share: sensor, output, camera."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import msgspec
from msgspec import UNSET, UnsetType

from flyaround.simulator.camera.detector.limits import DETECTOR, SENSOR
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.detector.sensor import Detector, Sensor, with_bits
from flyaround.simulator.camera.detector.shutter import EXPOSURE_S, READOUT_S, Shutter
from flyaround.simulator.camera.detector.transfer import default_encoding, encoding_problem
from flyaround.simulator.camera.encoding import Encoding
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.camera.lens.files import CameraFile, read_camera_file
from flyaround.simulator.camera.lens.files_native import PitchUm
from flyaround.simulator.camera.lens.intrinsics import CONSISTENCY_TOLERANCE
from flyaround.simulator.camera.sections import DetectorSection, crop_and_bin, sensor_region
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.auto_exposure import AutoExposure
from flyaround.simulator.runtime.sections import Section, within
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import Quality

Layer = Literal["all", "amodal", "parts", "depth", "normals", "flow", "clean", "wireframe"]


class SensorSection(Section, frozen=True, kw_only=True):
    """Noise recipe or detector by name, exposure, and changed parameters.

    With a detector (``imx174``, ``cmv4000``, or a section `[sensor.detector]`) photons and electrons are counted, and
    ``full_scale_j_m2_sr`` and the two variances are unused. ``roi_px`` (x0, y0, width, height) reads a region of the
    camera's pixels. ``binning`` is the number of pixels that are combined in each direction. The intrinsics are adapted
    to both. ``bits`` divides the full scale into more or fewer steps; ``gain_e_per_dn`` and ``black_level_dn`` in
    `[sensor.detector]` refer to these steps.
    """

    preset: Literal["speed", "thesis", "ideal", "imx174", "cmv4000"] = "speed"
    exposure_s: Annotated[float, within(EXPOSURE_S)] = 0.001
    full_scale_j_m2_sr: Annotated[float, within(SENSOR["full_scale_j_m2_sr"])] | None = None
    blur_sigma_px: Annotated[float, within(SENSOR["blur_sigma_px"])] | None = None
    speckle_variance: Annotated[float, within(SENSOR["speckle_variance"])] | None = None
    gaussian_variance: Annotated[float, within(SENSOR["gaussian_variance"])] | None = None
    bits: Annotated[int, within(SENSOR["bits"])] | None = None
    shutter: Literal["global", "rolling"] = "global"
    readout_s: Annotated[float, within(READOUT_S)] = 0.0
    motion_blur: bool = True
    pixel_pitch_um: tuple[PitchUm, PitchUm] | None = None
    detector: DetectorSection | None = None
    binning: Annotated[int, within(DETECTOR["binning"])] = 1
    roi_px: tuple[int, int, int, int] | None = None
    auto_exposure: AutoExposure | None = None

    def model(self, camera: CameraFile, source: str) -> Sensor:
        """Return the preset with this section's changes.

        Returns
        -------
        Sensor
            Sensor of the region and binning that are read out. Its pixel pitch is that of this section, else of the
            camera's file, else of the preset.

        Raises
        ------
        UserError
            If the camera's file has another pixel pitch than the named detector.
        """
        base = preset = sensor_preset(self.preset)
        if self.detector is not None and base.detector is None:
            base = replace(base, detector=Detector())
        if self.bits is not None:
            base = with_bits(base, self.bits)
        keys = ("full_scale_j_m2_sr", "blur_sigma_px", "speckle_variance", "gaussian_variance")
        changes = {key: getattr(self, key) for key in keys}
        sensor = replace(base, **{key: value for key, value in changes.items() if value is not None})
        pitch_um = self.pixel_pitch_um or _camera_pitch_um(camera, preset, source)
        if pitch_um is not None:
            x, y = pitch_um
            sensor = replace(sensor, pixel_pitch_x_m=x * 1e-6, pixel_pitch_y_m=y * 1e-6)
        if self.detector is not None:
            sensor = replace(sensor, detector=self.detector.detector(base.detector))
        return sensor_region(sensor, self.roi_px, self.binning)

    @property
    def shutter_model(self) -> Shutter:
        """The shutter: exposure times of the rows."""
        return Shutter(kind=self.shutter, readout_s=self.readout_s, motion_blur=self.motion_blur)


def _camera_pitch_um(camera: CameraFile, preset: Sensor, source: str) -> tuple[float, float] | None:
    """Return the pixel pitch of the camera's file; raise if it differs from that of the named detector."""
    pitch = camera.pixel_pitch_um
    preset_pitch = (preset.pixel_pitch_x_m * 1e6, preset.pixel_pitch_y_m * 1e6)
    if (
        pitch is not None
        and preset.detector is not None
        and max(abs(g / o - 1) for g, o in zip(pitch, preset_pitch, strict=True)) > CONSISTENCY_TOLERANCE
    ):
        raise UserError(
            f"{source}: the camera's file has pixels of {pitch[0]:g} x {pitch[1]:g} um, detector "
            f"{preset.preset} has {preset_pitch[0]:g} x {preset_pitch[1]:g}: choose one with [sensor] pixel_pitch_um"
        )
    return pitch


class Output(Section, frozen=True, kw_only=True):
    """Bands and quality of the image, and the label layers that a capture writes (``all`` for every layer).

    ``encoding`` is the transfer function of the image: ``linear``, ``srgb`` or ``gamma`` (a power of 1 / 2.2). By
    default it is that of the camera file. If the file has none, 8-bit colour images are ``srgb`` and all others linear.
    """

    bands: Bands = "mono"
    encoding: Encoding | UnsetType = UNSET
    quality: Quality = "default"
    labels: tuple[Layer, ...] = ()


D = TypeVar("D", bound="Document")


class Document(Section, frozen=True, kw_only=True):
    """Base of a scenario file and a recipe file.

    The fields are defined in each of the two, in the order in which a data set's card lists them.
    """

    if TYPE_CHECKING:
        schema: str
        name: str
        camera: str | CameraFile
        sensor: SensorSection
        output: Output

    @property
    def where(self) -> str:
        """Kind and name, for messages."""
        return f"{self.schema.removeprefix('flyaround.')} {self.name}"

    @property
    def camera_file(self) -> CameraFile:
        """The camera file; a built-in name is read on access."""
        return read_camera_file(self.camera) if isinstance(self.camera, str) else self.camera

    @property
    def camera_model(self) -> Camera:
        """The camera of the image, after region and binning."""
        return self.camera_in(self.output.bands)

    def camera_in(self, bands: Bands) -> Camera:
        """Return the camera of images in other bands, with their encoding.

        Raises
        ------
        UserError
            If the sensor's images cannot have the requested encoding.
        """
        file, sensor = self.camera_file, self.sensor_model
        encoding = self.output.encoding or file.encoding or default_encoding(sensor, bands)
        problem = encoding_problem(encoding, sensor)
        if problem is not None:
            raise UserError(f"{self.where}: key {problem}")
        camera = replace(file.camera(f"camera of {self.where}"), encoding=encoding)
        return crop_and_bin(camera, self.sensor.roi_px, self.sensor.binning, self.where)

    @property
    def sensor_model(self) -> Sensor:
        """The sensor's preset with its changes."""
        return self.sensor.model(self.camera_file, self.where)

    @property
    def auto_exposure(self) -> AutoExposure | None:
        """Automatic exposure, or None for a fixed one.

        Raises
        ------
        UserError
            If its limits are reversed.
        """
        auto = self.sensor.auto_exposure
        if auto is not None and auto.shortest_s > auto.longest_s:
            raise UserError(
                f"{self.where}: sensor.auto_exposure.shortest_s {auto.shortest_s:g} is longer than "
                f"longest_s {auto.longest_s:g}; exchange them"
            )
        return auto


def with_image_options(document: D, encoding: Encoding | None, *, auto_exposure: bool) -> D:
    """Return a document with changed image options.

    Parameters
    ----------
    document : Scenario or Recipe
        Document to change.
    encoding : Encoding or None
        New encoding, or None to keep it.
    auto_exposure : bool
        True to use automatic exposure.

    Returns
    -------
    Scenario or Recipe
        Document of the same type.
    """
    output, sensor = document.output, document.sensor
    if encoding is not None:
        output = msgspec.structs.replace(output, encoding=encoding)
    if auto_exposure and sensor.auto_exposure is None:
        sensor = msgspec.structs.replace(sensor, auto_exposure=AutoExposure())
    return msgspec.structs.replace(document, output=output, sensor=sensor)
