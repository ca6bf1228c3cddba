"""Lens distortion in normalised image coordinates: forward, inverse, and the domain where it is one to one.

Normalised coordinates are (x / z, y / z) of a point in the camera frame. Models and order of coefficients are OpenCV's:

- ``brown_conrady``: k1 k2 p1 p2 [k3 [k4 k5 k6]], Brown (1966), Decentering distortion of lenses; the last three
  make the radial part a ratio of polynomials.
- ``kannala_brandt``: k1 k2 k3 k4 of the angle from the axis, Kannala & Brandt (2006), A generic camera model and
  calibration method for conventional, wide-angle, and fish-eye lenses, IEEE TPAMI 28(8).

To add a model, add its name to `DistortionModel`, its numbers of coefficients to `COEFFICIENT_COUNTS`, the map and its
derivative to `distort` and `jacobian`, and the map to shaders/craft/lens.glsl. Then
tests/simulator/camera/test_distortion.py tests every round trip, and compares with OpenCV's projection.

A polynomial is not one to one at large radii. `LensDomain` uses it up to a radius just outside the image. Beyond that
radius the map is continued in proportion, so that points outside the field of view never land inside the image.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

DistortionModel = Literal["none", "brown_conrady", "kannala_brandt"]
COEFFICIENT_COUNTS: dict[str, tuple[int, ...]] = {
    "none": (0,),
    "brown_conrady": (4, 5, 8),
    "kannala_brandt": (4,),
}
MARGIN = 1.05
"""Radius up to which the polynomial is used if it is one to one, over the radius of the image's farthest corner: room
for motion blur and for the points of edges that cross the border. Chosen by eye."""
MAX_ANGLE_RAD = np.deg2rad(85.0)
"""Largest angle from the axis. Beyond it camera z, the depth of labels, is ill-conditioned."""
_TABLE = 4096  # number of angles in the look-up table of the inverse
# Residual of the inverse at which it stops, and above which a point has none; a wide-angle polynomial ends between
# them.
_CONVERGED, _ACCEPTED = 1e-13, 1e-9
_BORDER = 1.0001  # factor on the domain's radius, for the rounding of points on its border
# Squared radius below which the derivative is its series' first term, because the difference cancels.
_NEAR_AXIS = 1e-8
_INSIDE_FOLD = 0.999  # factor on the radius at which a lens folds back, to stay on the near side
_NEWTON_STEPS = 12  # largest number of Newton steps for the inverse; from the table's guess a few suffice


@dataclass(frozen=True)
class Distortion:
    """Lens distortion; ``coefficients`` in OpenCV's order for the model.

    Raises
    ------
    ValueError
        If the model is unknown, or the coefficients are too few, too many or not finite.
    """

    model: DistortionModel = "none"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        counts = COEFFICIENT_COUNTS.get(self.model)
        if counts is None:
            raise ValueError(f"distortion.model is {self.model!r}, allowed: {', '.join(COEFFICIENT_COUNTS)}")
        if len(self.coefficients) not in counts:
            allowed = " or ".join(str(n) for n in counts)
            raise ValueError(
                f"distortion.coefficients has {len(self.coefficients)} numbers, model {self.model} takes {allowed}"
            )
        if not np.isfinite(self.coefficients).all():
            raise ValueError(
                f"distortion.coefficients is {list(self.coefficients)}, finite numbers are needed"
            )

    @property
    def is_none(self) -> bool:
        """True if the lens is a pinhole. A fish-eye is not, even with all coefficients 0."""
        return self.model != "kannala_brandt" and not any(self.coefficients)


def distort(distortion: Distortion, xy: FloatArray) -> FloatArray:
    """Apply the model's polynomial to undistorted normalised coordinates (..., 2), at any radius."""
    xy = np.asarray(xy, float)
    if distortion.model == "none":
        return xy.copy()
    x, y = xy[..., 0], xy[..., 1]
    s = x * x + y * y
    distorted = xy * _radial(distortion, s)[0][..., None]
    if distortion.model == "brown_conrady":
        _, _, p1, p2 = distortion.coefficients[:4]
        distorted[..., 0] += 2 * p1 * x * y + p2 * (s + 2 * x * x)
        distorted[..., 1] += p1 * (s + 2 * y * y) + 2 * p2 * x * y
    return distorted


def jacobian(distortion: Distortion, xy: FloatArray) -> FloatArray:
    """Return the Jacobian matrices (..., 2, 2) of `distort`: [[dxd/dx, dxd/dy], [dyd/dx, dyd/dy]]."""
    xy = np.asarray(xy, float)
    if distortion.model == "none":
        return np.broadcast_to(np.eye(2), (*xy.shape, 2)).copy()
    x, y = xy[..., 0], xy[..., 1]
    scale, slope = _radial(distortion, x * x + y * y)  # and its derivative by the argument
    J = np.empty((*xy.shape, 2))
    J[..., 0, 0] = scale + 2 * x * x * slope
    J[..., 0, 1] = J[..., 1, 0] = 2 * x * y * slope
    J[..., 1, 1] = scale + 2 * y * y * slope
    if distortion.model == "brown_conrady":
        _, _, p1, p2 = distortion.coefficients[:4]
        J[..., 0, 0] += 2 * p1 * y + 6 * p2 * x
        J[..., 0, 1] += 2 * p1 * x + 2 * p2 * y
        J[..., 1, 0] += 2 * p1 * x + 2 * p2 * y
        J[..., 1, 1] += 6 * p1 * y + 2 * p2 * x
    return J


def _radial(distortion: Distortion, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the radial factor, and its derivative with respect to the squared undistorted radius ``s``."""
    if distortion.model == "brown_conrady":
        k = np.zeros(8)
        k[: len(distortion.coefficients)] = distortion.coefficients
        k1, k2, _, _, k3, k4, k5, k6 = (float(value) for value in k)
        top, bottom = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
        d_top, d_bottom = k1 + s * (2 * k2 + s * 3 * k3), k4 + s * (2 * k5 + s * 3 * k6)
        return top / bottom, (d_top - top / bottom * d_bottom) / bottom
    k1, k2, k3, k4 = distortion.coefficients
    r = np.sqrt(np.maximum(s, 1e-24))
    angle = np.arctan(r)
    t = angle * angle
    series = 1 + t * (k1 + t * (k2 + t * (k3 + t * k4)))
    # derivative of angle * series by the angle
    d_series = 1 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * 9 * k4)))
    scale = angle * series / r
    d_scale = (d_series / (1 + s) - scale) / (2 * np.maximum(s, 1e-24))
    d_scale = np.where(s < _NEAR_AXIS, k1 - 1 / 3, d_scale)
    return scale, d_scale


@dataclass(frozen=True, eq=False)
class LensDomain:
    """Domain of a lens: up to an undistorted radius just outside the image.

    Parameters
    ----------
    distortion : Distortion
        Model and coefficients of the lens.
    limit : float
        Largest undistorted radius [1], infinite for a pinhole.
    radius : array
        Undistorted radii of a look-up table for initial guesses.
    image_radius : array
        Distorted radii of the same table.
    """

    distortion: Distortion
    limit: float
    radius: FloatArray
    image_radius: FloatArray

    def distort(self, xy: FloatArray) -> FloatArray:
        """Return distorted coordinates (..., 2); beyond ``limit`` extended in proportion to the radius."""
        xy = np.asarray(xy, float)
        if self.distortion.is_none:
            return xy.copy()
        r = np.hypot(xy[..., 0], xy[..., 1])
        with np.errstate(invalid="ignore"):
            excess = np.maximum(r / self.limit, 1.0)[..., None]
            return distort(self.distortion, xy / excess) * excess

    def undistort(self, image_xy: FloatArray) -> FloatArray:
        """Return undistorted coordinates (..., 2), whose distorted ones agree to 1e-9; NaN outside the domain."""
        image_xy = np.asarray(image_xy, float)
        if self.distortion.is_none:
            return image_xy.copy()
        r = np.hypot(image_xy[..., 0], image_xy[..., 1])
        guess = np.interp(r, self.image_radius, self.radius)
        with np.errstate(all="ignore"):
            xy = image_xy * np.where(r > 0, guess / np.where(r > 0, r, 1), 1.0)[..., None]
            for _ in range(_NEWTON_STEPS):
                residual = distort(self.distortion, xy) - image_xy
                if np.nanmax(np.abs(residual), initial=0.0) < _CONVERGED:
                    break
                J = jacobian(self.distortion, xy)
                a, b, c, d = J[..., 0, 0], J[..., 0, 1], J[..., 1, 0], J[..., 1, 1]
                step = np.stack(
                    [
                        d * residual[..., 0] - b * residual[..., 1],
                        a * residual[..., 1] - c * residual[..., 0],
                    ],
                    -1,
                )
                xy = xy - step / (a * d - b * c)[..., None]
            is_invalid = np.abs(distort(self.distortion, xy) - image_xy).max(axis=-1) > _ACCEPTED
            is_invalid |= ~(np.hypot(xy[..., 0], xy[..., 1]) <= self.limit * _BORDER)
        xy[is_invalid] = np.nan
        return xy


def lens_domain(distortion: Distortion, border_xy: FloatArray, *, strict: bool = True) -> LensDomain:
    """Return the domain of a lens over an image whose border is at distorted coordinates ``border_xy`` (K, 2).

    Parameters
    ----------
    distortion : Distortion
        Model and coefficients of the lens.
    border_xy : (K, 2) array
        Distorted coordinates of the image's border, at unit depth.
    strict : bool, optional
        True to refuse an image that the lens does not fill; otherwise the lens is used as far as it reaches.

    Raises
    ------
    ValueError
        If the lens folds back inside the image, or reaches beyond 85 degrees from its axis.
    """
    max_radius = np.tan(MAX_ANGLE_RAD)
    too_wide = (
        f"the image reaches further than {np.rad2deg(MAX_ANGLE_RAD):.0f} degrees off the axis; "
        "allowed is less: make the image smaller or the focal length longer"
    )
    if distortion.is_none:
        if strict and np.hypot(border_xy[:, 0], border_xy[:, 1]).max() > max_radius:
            raise ValueError(too_wide)
        return LensDomain(distortion, np.inf, np.zeros(1), np.zeros(1))
    angles = np.linspace(0, MAX_ANGLE_RAD, _TABLE)
    radius = np.tan(angles)
    with np.errstate(all="ignore"):
        scale, slope = _radial(distortion, radius**2)
        image_radius, radial_slope = radius * scale, scale + 2 * radius**2 * slope
    # the radial part is one to one until it stops increasing, or until a pole of the rational model
    is_folded = ~((radial_slope > 0) & (scale > 0) & np.isfinite(image_radius))
    end = int(np.argmax(is_folded)) if is_folded.any() else _TABLE
    if end < 2:
        raise ValueError("the distortion turns the image inside out at its centre")
    corner = float(np.hypot(border_xy[:, 0], border_xy[:, 1]).max())
    full_domain = LensDomain(distortion, float(radius[end - 1]), radius[:end], image_radius[:end])
    rays = full_domain.undistort(border_xy)
    if not strict and not np.isfinite(rays).all():
        return LensDomain(distortion, _INSIDE_FOLD * float(radius[end - 1]), radius[:end], image_radius[:end])
    if not np.isfinite(rays).all():
        if corner < image_radius[end - 1]:
            raise ValueError("the distortion folds back inside the image: its tangential terms are too large")
        if end == _TABLE:
            raise ValueError(too_wide)
        raise ValueError(
            "the distortion folds back inside the image: it reaches "
            f"{image_radius[end - 1]:.4g} focal lengths from the principal point at most, the image's corner is at "
            f"{corner:.4g}; check the coefficients and their order"
        )
    reach = float(np.hypot(rays[:, 0], rays[:, 1]).max())
    limit = min(MARGIN * reach, 0.5 * (reach + float(radius[end - 1])), max_radius)
    domain = LensDomain(distortion, limit, radius[:end], image_radius[:end])
    if not strict:
        return domain
    # with tangential terms too, the map must preserve orientation over the whole disc
    r, azimuth = np.meshgrid(np.linspace(0, limit, 24), np.linspace(0, 2 * np.pi, 49))
    if (
        np.linalg.det(jacobian(distortion, np.stack([r * np.cos(azimuth), r * np.sin(azimuth)], -1))).min()
        <= 0
    ):
        raise ValueError("the distortion folds back inside the image: its tangential terms are too large")
    return domain
