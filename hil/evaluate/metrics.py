"""Metrics that summarise a set of estimated poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.hil.evaluate.mean_predictor import MeanPredictor
from flyaround.hil.evaluate.pose_errors import FrameScore
from flyaround.hil.evaluate.pose_spread import PoseSpread, pose_spread
from flyaround.simulator.runtime.arrays import vec3

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

SCHEMA = "flyaround.metrics"
VERSION = 1  # of the file format, in docs/formats

# Bins of the true range [m], open above the last one.
RANGE_BINS_M = (
    (0.0, 3.0),
    (3.0, 6.0),
    (6.0, 9.0),
    (9.0, 12.0),
    (12.0, 15.0),
    (15.0, 18.0),
    (18.0, float("inf")),
)

# Label accuracy of SPEED+, below which its score counts no error (Park et al. 2023, Satellite Pose Estimation
# Competition 2021): 0.169 deg, 2.173 mm per m.
SPEED_PLUS_DEG, SPEED_PLUS_SHARE = 0.169, 2.173e-3


# Minimum number of values for a meaningful bootstrap interval.
MIN_BOOTSTRAP = 5

# 95 % quantile of chi-square with six degrees of freedom. scipy.stats.chi2.ppf(0.95, 6).
CHI_SQUARE_6_95 = 12.592


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """Metrics of a group of frames; None if there is nothing to average.

    Errors ``*_deg`` and ``*_m`` are over accepted frames, or with ``_all`` over every feasible frame with a pose.
    ``*_wilson`` is the 95 % interval of the share of that name, ``*_bootstrap`` that of the median or mean of that
    name.

    Parameters
    ----------
    n : int
        Number of frames.
    n_feasible : int
        Number of feasible frames.
    n_accepted : int
        Number of accepted frames.
    coarse_success : float or None
        Share of feasible frames whose best pose, accepted or not, is within 5 deg and 5 % of the range.
    fine_success : float or None
        Share of feasible frames whose best pose, accepted or not, is within 0.5 deg and 0.5 % of the range.
    coarse_accepted : float or None
        Share of feasible frames that are accepted and coarse.
    availability : float or None
        Share of feasible frames that are accepted.
    false_accept : float or None
        Share of accepted frames that are not coarse, infeasible frames included.
    speed_score : float or None
        Mean of E_R [rad] + e_t over every feasible frame with a pose.
    speed_plus_score : float or None
        The same with errors below SPEED+'s label accuracy set to zero.
    median_nees : float, optional
        Median NEES of accepted frames; 5.35 if the covariances are correct.
    nees_inside_95 : float, optional
        Share of accepted frames with a NEES within the 95 % quantile of chi-square, six degrees of freedom.
    """

    n: int
    n_feasible: int
    n_accepted: int
    coarse_success: float | None
    fine_success: float | None
    coarse_accepted: float | None
    availability: float | None
    false_accept: float | None
    median_E_R_deg: float | None
    median_E_T_m: float | None
    mean_E_T_m: float | None
    mean_E_R_deg: float | None
    p95_E_R_deg: float | None
    p95_E_T_m: float | None
    median_E_R_deg_all: float | None
    median_E_T_m_all: float | None
    mean_E_T_m_all: float | None
    mean_E_R_deg_all: float | None
    p95_E_R_deg_all: float | None
    p95_E_T_m_all: float | None
    coarse_success_wilson: tuple[float, float] | None
    fine_success_wilson: tuple[float, float] | None
    coarse_accepted_wilson: tuple[float, float] | None
    availability_wilson: tuple[float, float] | None
    false_accept_wilson: tuple[float, float] | None
    speed_score: float | None
    speed_plus_score: float | None
    median_nees: float | None = None
    nees_inside_95: float | None = None
    median_E_R_deg_bootstrap: tuple[float, float] | None = None
    median_E_T_m_bootstrap: tuple[float, float] | None = None
    mean_E_R_deg_bootstrap: tuple[float, float] | None = None
    mean_E_T_m_bootstrap: tuple[float, float] | None = None
    median_E_R_deg_all_bootstrap: tuple[float, float] | None = None
    median_E_T_m_all_bootstrap: tuple[float, float] | None = None
    mean_E_R_deg_all_bootstrap: tuple[float, float] | None = None
    mean_E_T_m_all_bootstrap: tuple[float, float] | None = None


class RangeBin(Summary, frozen=True, kw_only=True):
    """Metrics of the frames between two true ranges; unbounded if ``to_m`` is None."""

    from_m: float
    to_m: float | None


class MethodMetrics(Summary, frozen=True, kw_only=True):
    """Metrics of one method, overall, by range and by class.

    Parameters
    ----------
    method : str, optional
        Name of the method.
    by_range : list of RangeBin
        Metrics of each interval of range.
    by_class : dict of str to Summary
        Metrics of each class of frames.
    failures : dict of str to int, optional
        Number of feasible frames that are not coarse, by the stage that failed.
    bias_m : tuple of float, optional
        Mean position error of accepted frames along camera x, y, z.
    spread_m : tuple of float, optional
        Standard deviation of the position error.
    turn_bias_deg : tuple of float, optional
        Mean attitude error about these axes.
    turn_spread_deg : tuple of float, optional
        Standard deviation of the attitude error.
    time_ms_p50 : float, optional
        Median time per frame on the machine of the evaluation.
    time_ms_p95 : float, optional
        95th percentile of the time per frame.
    spread : PoseSpread, optional
        Spread of accepted poses' errors, for a navigation filter; None for too few poses.
    """

    method: str = ""
    by_range: list[RangeBin]
    by_class: dict[str, Summary]
    failures: dict[str, int] = {}
    bias_m: tuple[float, float, float] | None = None
    spread_m: tuple[float, float, float] | None = None
    turn_bias_deg: tuple[float, float, float] | None = None
    turn_spread_deg: tuple[float, float, float] | None = None
    time_ms_p50: float | None = None
    time_ms_p95: float | None = None
    spread: PoseSpread | None = None


class Metrics(MethodMetrics, frozen=True, kw_only=True):
    """Contents of ``metrics.json``: the first method's metrics at the top level, all methods by name.

    Parameters
    ----------
    schema : str, optional
        Name of the format.
    version : int, optional
        Version of the format.
    kernels : str, optional
        Implementation of the inner loops: ``native`` and the library's file, or ``none`` and the reason.
    pictures : str, optional
        Description of the images.
    grey_from_colour : bool, optional
        True if colour images were converted to grey.
    mean_predictor : MeanPredictor, optional
        Errors of the mean pose as the answer to every feasible frame; None without feasible frames.
    by_method : dict of str to MethodMetrics, optional
        Metrics of each method by name.
    """

    schema: str = SCHEMA
    version: int = VERSION
    kernels: str = ""
    pictures: str = ""
    grey_from_colour: bool = False
    mean_predictor: MeanPredictor | None = None
    by_method: dict[str, MethodMetrics] = {}


def wilson_interval(k: int, n: int) -> tuple[float, float] | None:
    """Return Wilson's 95 % score interval of a share ``k / n``.

    Returns
    -------
    tuple of float or None
        Lower and upper bound, 0 to 1; None if ``n`` is 0.

    References
    ----------
    Wilson (1927), JASA 22, 209.
    """
    from scipy.stats import binomtest  # noqa: PLC0415 - slow to import, and only used here

    if n <= 0:
        return None
    interval = binomtest(k, n).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def bootstrap_intervals(
    values: Sequence[float], resamples: int = 1000
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Return the 95 % percentile intervals of the median and of the mean.

    The random generator is seeded, so that the same values give the same intervals.

    Returns
    -------
    median : tuple of float or None
        Lower and upper bound of the median, in the unit of the values; None for fewer than five values.
    mean : tuple of float or None
        The same of the mean.

    References
    ----------
    Efron & Tibshirani (1993), An Introduction to the Bootstrap, ch. 13.
    """
    if len(values) < MIN_BOOTSTRAP:
        return None, None
    sample = np.asarray(values, float)
    resamples_drawn = sample[
        np.random.default_rng(len(sample)).integers(0, len(sample), (resamples, len(sample)))
    ]
    median = np.percentile(np.median(resamples_drawn, axis=1), [2.5, 97.5])
    mean = np.percentile(resamples_drawn.mean(axis=1), [2.5, 97.5])
    return (float(median[0]), float(median[1])), (float(mean[0]), float(mean[1]))


def summarise(
    records: Iterable[FrameScore],
    *,
    method: str = "",
    failures: Sequence[str] = (),
    times_ms: Sequence[float] = (),
) -> MethodMetrics:
    """Return the metrics of a set of frames, overall, by range and by class.

    Parameters
    ----------
    records : iterable of FrameScore
        Scores of the frames.
    method : str, optional
        Name of the method.
    failures : sequence of str, optional
        Stage that failed, one entry for each feasible frame that is not coarse.
    times_ms : sequence of float, optional
        Time of each frame [ms].
    """
    frames = list(records)
    bins = []
    for low, high in RANGE_BINS_M:
        part = [r for r in frames if low <= r.range_m < high]
        if part:
            bins.append(RangeBin(from_m=low, to_m=high if np.isfinite(high) else None, **_figures(part)))
    classes = sorted({r.frame_class for r in frames})
    by_class = {c: Summary(**_figures([r for r in frames if r.frame_class == c])) for c in classes}
    shifts = np.array([r.shift_camera_m for r in frames if r.accepted and r.shift_camera_m is not None])
    turns = np.array([r.turn_camera_deg for r in frames if r.accepted and r.turn_camera_deg is not None])
    return MethodMetrics(
        method=method,
        by_range=bins,
        by_class=by_class,
        failures={kind: failures.count(kind) for kind in sorted(set(failures))},
        bias_m=vec3(shifts.mean(axis=0)) if len(shifts) else None,
        spread_m=vec3(shifts.std(axis=0)) if len(shifts) else None,
        turn_bias_deg=vec3(turns.mean(axis=0)) if len(turns) else None,
        turn_spread_deg=vec3(turns.std(axis=0)) if len(turns) else None,
        time_ms_p50=_reduce(np.median, times_ms),
        time_ms_p95=_reduce(_p95, times_ms),
        spread=pose_spread(frames),
        **_figures(frames),
    )


def compose(
    methods: Sequence[MethodMetrics],
    kernels: str = "",
    pictures: str = "",
    *,
    grey_from_colour: bool = False,
    mean_predictor: MeanPredictor | None = None,
) -> Metrics:
    """Return the document of ``metrics.json``: the first method at the top level, all methods by name.

    Parameters
    ----------
    methods : sequence of MethodMetrics
        Metrics of each method, at least one.
    kernels : str, optional
        Implementation of the estimators' kernels.
    pictures : str, optional
        Description of the images.
    grey_from_colour : bool, optional
        True if colour images were converted to grey.
    mean_predictor : MeanPredictor, optional
        Errors of the mean pose as the answer to every feasible frame.

    Raises
    ------
    ValueError
        If there is no method.
    """
    if not methods:
        raise ValueError("metrics need at least one method")
    top = {name: getattr(methods[0], name) for name in MethodMetrics.__struct_fields__}
    return Metrics(
        by_method={m.method: m for m in methods},
        kernels=kernels,
        pictures=pictures,
        grey_from_colour=grey_from_colour,
        mean_predictor=mean_predictor,
        **top,
    )


def _figures(frames: Sequence[FrameScore]) -> dict[str, Any]:
    feasible = [r for r in frames if r.feasible]
    accepted = [r for r in frames if r.accepted]
    shares = {
        "coarse_success": (sum(r.coarse for r in feasible), len(feasible)),
        "fine_success": (sum(r.fine for r in feasible), len(feasible)),
        "coarse_accepted": (sum(r.coarse and r.accepted for r in feasible), len(feasible)),
        "availability": (sum(r.accepted for r in feasible), len(feasible)),
        "false_accept": (sum(not r.coarse for r in accepted), len(accepted)),
    }
    out: dict[str, Any] = {"n": len(frames), "n_feasible": len(feasible), "n_accepted": len(accepted)}
    for name, (k, n) in shares.items():
        out[name] = k / n if n else None
        out[f"{name}_wilson"] = wilson_interval(k, n)
    for suffix, part in (("", accepted), ("_all", feasible)):
        turn = [r.E_R_deg for r in part if r.E_R_deg is not None]
        shift = [r.E_T_m for r in part if r.E_T_m is not None]
        for statistic, function in (("median", np.median), ("mean", np.mean), ("p95", _p95)):
            out[f"{statistic}_E_R_deg{suffix}"] = _reduce(function, turn)
            out[f"{statistic}_E_T_m{suffix}"] = _reduce(function, shift)
        for field, values in (("E_R_deg", turn), ("E_T_m", shift)):
            median, mean = bootstrap_intervals(values)
            out[f"median_{field}{suffix}_bootstrap"] = median
            out[f"mean_{field}{suffix}_bootstrap"] = mean
    nees = [r.nees for r in accepted if r.nees is not None]
    out["median_nees"] = _reduce(np.median, nees)
    out["nees_inside_95"] = sum(x <= CHI_SQUARE_6_95 for x in nees) / len(nees) if nees else None
    scores = [
        (float(np.radians(r.E_R_deg)), r.e_t) for r in feasible if r.E_R_deg is not None and r.e_t is not None
    ]
    floor = float(np.radians(SPEED_PLUS_DEG))
    out["speed_score"] = _reduce(np.mean, [a + b for a, b in scores])
    out["speed_plus_score"] = _reduce(
        np.mean, [(a if a > floor else 0.0) + (b if b > SPEED_PLUS_SHARE else 0.0) for a, b in scores]
    )
    return out


def _p95(values: FloatArray) -> np.floating[Any]:
    return np.percentile(values, 95)


def _reduce(function: Callable[[Any], Any], values: Sequence[float]) -> float | None:
    return float(function(np.asarray(values, float))) if values else None
