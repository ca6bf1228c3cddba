"""Named sensors: noise recipes of public data sets, and detectors from their data sheets."""

from __future__ import annotations

from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.errors import UserError

_PRESETS = {
    # Kisantal et al. (2020), Satellite Pose Estimation Challenge, IEEE TAES 56(5): blur 1 px, variance 0.0022
    "speed": Sensor(preset="speed", blur_sigma_px=1.0, speckle_variance=0.0, gaussian_variance=0.0022),
    # the recipe of the Milan thesis: speckle 0.004, then Gaussian 0.003
    "thesis": Sensor(preset="thesis", blur_sigma_px=1.0, speckle_variance=0.004, gaussian_variance=0.003),
    "ideal": Sensor(preset="ideal", blur_sigma_px=0.0, speckle_variance=0.0, gaussian_variance=0.0),
    # Sony IMX174 mono (the detector of SPEED's camera) by EMVA 1288: Point Grey (2015), Sony Pregius global shutter
    # CMOS imaging performance, camera GS3-U3-23S6M: quantum efficiency 76 % at 525 nm, read noise 6.83 e, full well
    # 32691 e, 45.1 dB, 0.51 e per step of 16 bits (8.16 e per step of 12 bits). The mean efficiency over 450 to 750 nm
    # is about four fifths of the peak. Dark current, DSNU, PRNU, black level and hot pixels are not published there;
    # the values are typical of such a detector at room temperature.
    "imx174": Sensor(
        preset="imx174",
        blur_sigma_px=0.0,
        bits=12,
        pixel_pitch_x_m=5.86e-6,
        pixel_pitch_y_m=5.86e-6,
        detector=Detector(
            quantum_efficiency=(0.62,),
            full_well_e=32_691.0,
            gain_e_per_dn=8.16,
            black_level_dn=64.0,
            read_noise_e=6.83,
            dark_current_e_s=4.0,
            dark_doubling_c=7.0,
            dsnu_e=1.5,
            dark_nonuniformity=0.2,
            prnu=0.005,
            hot_pixel_share=1e-5,
            hot_pixel_e_s=2000.0,
        ),
    ),
    # ams (formerly CMOSIS) CMV4000 mono, 2048 x 2048, for star trackers and inspection cameras: data sheet DS000728
    # v7-00. Pitch 5.5 um, full well 13.5 ke, gain 0.075 DN/e at 10 bits, read noise 13 e, dark current 125 e/s at 25
    # deg C (doubling every 6.5 K), quantum efficiency 60 % at 550 nm with microlenses (about 48 % over 450 to 750 nm),
    # PRNU < 1 %. Its DSNU of 3 DN/s is 40 e/s, a third of the dark current. Its fixed pattern is < 1 DN rms; the offset
    # here is 5 e. Column noise, black level and hot pixels are typical values.
    "cmv4000": Sensor(
        preset="cmv4000",
        blur_sigma_px=0.0,
        bits=10,
        pixel_pitch_x_m=5.5e-6,
        pixel_pitch_y_m=5.5e-6,
        detector=Detector(
            quantum_efficiency=(0.48,),
            full_well_e=13_500.0,
            gain_e_per_dn=1 / 0.075,
            black_level_dn=10.0,
            read_noise_e=13.0,
            column_noise_e=2.0,
            dark_current_e_s=125.0,
            dark_reference_c=25.0,
            dark_doubling_c=6.5,
            dsnu_e=5.0,
            dark_nonuniformity=0.32,
            prnu=0.01,
            hot_pixel_share=1e-4,
            hot_pixel_e_s=3000.0,
        ),
    ),
}


def list_sensor_presets() -> tuple[str, ...]:
    """Return the names of the built-in presets.

    Returns
    -------
    tuple of str
        Names that `sensor_preset` accepts.
    """
    return tuple(_PRESETS)


def sensor_preset(name: str) -> Sensor:
    """Return the preset called ``name``.

    Returns
    -------
    Sensor
        Sensor of the preset.

    Raises
    ------
    UserError
        If there is none.
    """
    if name not in _PRESETS:
        raise UserError(f"there is no sensor preset {name!r}: choose one of {', '.join(_PRESETS)}")
    return _PRESETS[name]
