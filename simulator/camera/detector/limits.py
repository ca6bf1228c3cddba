"""Validation of the parameters of a sensor and its optics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.response import limits_nm, sample_curve
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.runtime.sections import bounds_of

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.response import Curve
    from flyaround.simulator.camera.lens.camera_model import Camera

# Largest width and height of a measured kernel [px]: the convolution's 128 frequencies hold kernels of half that size.
MAX_KERNEL_SIZE = 63

# Tolerance of a kernel's sum, for kernels printed with few digits.
KERNEL_SUM_ERROR = 1e-3

# Largest dark current at the detector's temperature [e s-1], the bound of `Detector.dark_current_e_s` at its reference.
MAX_DARK_E_S = 1e9

# field: smallest and largest value
OPTICS, DETECTOR, SENSOR = bounds_of(Optics), bounds_of(Detector), bounds_of(Sensor)


def optics_problem(optics: Optics) -> str | None:
    """Describe the first invalid parameter of the optics.

    Returns
    -------
    str or None
        Parameter, value and allowed range; None if all are valid.
    """
    problem = _out_of_range(optics, "optics") or _curve_problem(
        optics.transmission_curve, "optics.transmission_curve"
    )
    if problem is not None or optics.psf != "kernel":
        return problem
    if len({len(row) for row in optics.kernel}) != 1:
        return "optics.kernel is empty or has rows of different lengths, allowed: a table of numbers"
    kernel = np.array(optics.kernel, float)
    if (
        kernel.size == 0
        or kernel.shape[0] % 2 == 0
        or kernel.shape[1] % 2 == 0
        or max(kernel.shape) > MAX_KERNEL_SIZE
    ):
        return (
            f"optics.kernel is {kernel.shape[0]} x {kernel.shape[-1]}, allowed: odd numbers of rows and columns up to "
            f"{MAX_KERNEL_SIZE}, so that there is a middle"
        )
    if not np.isfinite(kernel).all() or kernel.min() < 0:
        return "optics.kernel has a value that is negative or not finite: light is neither"
    if abs(kernel.sum() - 1) > KERNEL_SUM_ERROR:
        return f"optics.kernel sums to {kernel.sum():.6g}, allowed: 1 within {KERNEL_SUM_ERROR:g}; divide it by its sum"
    return None


def focus_problem(optics: Optics, camera: Camera, sensor: Sensor) -> str | None:
    """Describe a focus within the focal length, where a lens forms no real image.

    Returns
    -------
    str or None
        Parameter, value and allowed range; None if the lens can focus, or defocus is off.
    """
    focal_length_m = optics.focal_length_m(camera, sensor)
    if not optics.defocus or optics.focus_distance_m == 0 or optics.focus_distance_m > focal_length_m:
        return None
    return (
        f"optics.focus_distance_m is {optics.focus_distance_m:g}, allowed: 0 for infinity, or more than the focal "
        f"length of {focal_length_m:g} m"
    )


def sensor_problem(sensor: Sensor) -> str | None:
    """Describe the first invalid parameter of the sensor.

    Returns
    -------
    str or None
        Parameter, value and allowed range; None if all are valid.
    """
    problem = _out_of_range(sensor, "sensor")
    if problem is not None or sensor.detector is None:
        return problem
    d = sensor.detector
    problem = _out_of_range(d, "sensor.detector")
    if problem is not None:
        return problem
    if len(d.quantum_efficiency) not in {1, 3} or not all(0 < q <= 1 for q in d.quantum_efficiency):
        return (
            f"sensor.detector.quantum_efficiency is {list(d.quantum_efficiency)}, allowed: one number above 0 and up "
            "to 1, or three for red, green and blue"
        )
    problem = _curve_problem(d.quantum_efficiency_curve, "sensor.detector.quantum_efficiency_curve")
    if problem is not None:
        return problem
    try:
        dark_e_s = d.dark_e_s
    except OverflowError:
        dark_e_s = float("inf")
    if dark_e_s > MAX_DARK_E_S:
        return (
            f"sensor.detector.dark_current_e_s is {dark_e_s:.3g} at {d.temperature_c:g} deg C, doubling every "
            f"{d.dark_doubling_c:g} K; allowed: up to {MAX_DARK_E_S:g} at the temperature given"
        )
    if d.black_level_dn >= 2**sensor.bits - 1:
        return (
            f"sensor.detector.black_level_dn is {d.black_level_dn:g}, allowed: less than the full scale of "
            f"{2**sensor.bits - 1} at {sensor.bits} bits"
        )
    return None


def response_problem(sensor: Sensor, optics: Optics, bands: int) -> str | None:
    """Describe the first of one or three bands in which lens and detector leave no signal.

    Returns
    -------
    str or None
        Both curves and the limits of the band [nm]; None if every band has a signal, or the sensor has no detector.
    """
    d = sensor.detector
    if d is None:
        return None
    for low, high in limits_nm(bands):
        wavelength_nm = np.arange(low, high) + 0.5
        response = sample_curve(d.quantum_efficiency_curve, wavelength_nm, 1.0)
        if not (response * sample_curve(optics.transmission_curve, wavelength_nm, 1.0)).any():
            return (
                "sensor.detector.quantum_efficiency_curve and optics.transmission_curve leave no light between "
                f"{low:g} and {high:g} nm, allowed: some in every band of the picture"
            )
    return None


def _curve_problem(curve: Curve, name: str) -> str | None:
    if not curve:
        return None
    table = np.array(curve, float)
    if len(table) < 2 or not (np.diff(table[:, 0]) > 0).all():
        return f"{name} has {len(table)} points, allowed: two or more, their wavelengths ascending"
    low, high = OPTICS["wavelength_m"]
    if not ((table[:, 0] >= low) & (table[:, 0] <= high)).all():
        return f"{name} has a wavelength outside {low * 1e9:g} to {high * 1e9:g} nm"
    if not ((table[:, 1] >= 0) & (table[:, 1] <= 1)).all():
        return f"{name} has a share outside 0 to 1"
    return None


def _out_of_range(parameters: Optics | Detector | Sensor, name: str) -> str | None:
    for key, (low, high) in bounds_of(parameters).items():
        value = getattr(parameters, key)
        if not low <= value <= high:  # NaN fails too
            return f"{name}.{key} is {value:g}, allowed: {low:g} to {high:g}"
    return None
