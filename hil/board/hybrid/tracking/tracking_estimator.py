"""Method ``hybrid-track``: ``hybrid`` until a pose is accepted, then edge tracking with a filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Optional, Sequence

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.record import StageRecord, Trace
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.decide.confidence import MIN_EDGES, MIN_MATCHED, Evidence
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.hypotheses.ambiguity import largest_sigma
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.tracking.edge_tracker import TrackFit, track_edges
from flyaround.hil.board.hybrid.tracking.photometric_tracker import align_photometrically, find_sun
from flyaround.hil.board.hybrid.tracking.pose_filter import (
    TrackState,
    first_state,
    innovation,
    predict,
    update,
)
from flyaround.hil.board.method_names import HYBRID_TRACK

Array = np.ndarray

# Default time between frames [s].
DEFAULT_INTERVAL_S = 1.0

# Largest search range of edges, beyond which the target is initialised again, and minimum range [px].
MAX_REACH_PX, MIN_REACH_PX = 60.0, 6.0
# One-sigma errors of an initialisation: attitude [rad], position across and along the line of sight [share of range].
INITIAL_SIGMA_RAD, INITIAL_SIGMA_ACROSS, INITIAL_SIGMA_ALONG = float(np.radians(1.0)), 0.001, 0.006
# Maximum RMS residual of an accepted fit [px], and minimum confidence.
MAX_RMS_PX, MIN_CONFIDENCE = 2.5, 0.5

# Confidence below which, and attitude sigma above which [rad], the synthetic view is compared as well, because the
# edges of a single visible face constrain its tilt weakly.
CONFIDENT, MAX_TILT_SIGMA_RAD = 0.9, float(np.radians(0.6))

# Sigma of the predicted attitude above which it cannot detect a lock on wrong edges [rad], while the rates are
# uncertain.
MAX_PREDICTION_SIGMA_RAD = float(np.radians(1.8))

# Squared Mahalanobis distance of an innovation above which the synthetic view is compared: 95 % of chi-square.
INNOVATION_95 = 12.6

# Largest number of successive frames tracked by edges alone; the synthetic view detects their drift.
MAX_EDGE_ONLY_FRAMES = 5

# Angle between edge fit and prediction below which these are not compared [rad]; alignments per search of the Sun.
AGREEMENT_RAD, SUN_SEARCH_INTERVAL = float(np.radians(1.0)), 3

# Angle between the poses aligned on edges and on the synthetic view above which the track is dropped [rad]: one of the
# two is wrong, and a tilt that explains the edges or a saturated face as well does not tell which.
MAX_DISAGREEMENT_RAD = float(np.radians(2.0))

# Innovation gate: 99.99 % of chi-square with 6 degrees of freedom.
INNOVATION_GATE = 27.9

# Log-likelihood by which the keypoint network must prefer another pose for the track to be dropped.
MAX_LOG_LIKELIHOOD_DEFICIT = 6.0

# Largest number of successive frames without a good fit that the filter bridges.
MAX_COASTED_FRAMES = 2


class TrackingEstimator(Estimator):
    """Estimator that tracks the target through the frames of a sequence.

    Parameters
    ----------
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.

    Notes
    -----
    Frames must come in order of exposure; a ``t_s`` that does not increase starts a new sequence.
    """

    method = HYBRID_TRACK
    keeps_state = True
    takes_sun = True

    def __init__(self, model: BoardModel, camera: CameraIntrinsics) -> None:
        super().__init__(model, camera)
        self.first = PoseEstimator(model, camera)
        self.craft = self.first.target
        self.reset()

    def reset(self) -> None:
        """Drop the track."""
        self.state: Optional[TrackState] = None
        self.at_s: Optional[float] = None
        self.polarity = np.zeros(len(self.craft.samples))
        self.missed = 0
        self.edge_only_frames = 0
        self.photometric_alignments = 0
        self.empty = False
        self.sun: Optional[Array] = None

    def estimate(
        self,
        image: Any,  # noqa: ANN401 - see Estimator.estimate
        trace: Optional[Trace] = None,
        t_s: Optional[float] = None,
        sun_camera: Optional[Sequence[float]] = None,
    ) -> PoseResult:
        """Estimate the pose in the next frame of the sequence.

        Parameters
        ----------
        image : array
            Image, as for `Estimator.estimate`.
        trace : Trace, optional
            Receives the intermediate results.
        t_s : float, optional
            Time of exposure [s]; by default ``DEFAULT_INTERVAL_S`` after the last frame. A time that does not increase
            starts a new sequence.
        sun_camera : sequence of float, optional
            Unit vector to the Sun, camera axes.
        """
        if t_s is not None and not np.isfinite(t_s):
            t_s = None
        dt = DEFAULT_INTERVAL_S if t_s is None or self.at_s is None else t_s - self.at_s
        if dt <= 0:
            self.reset()
            dt = DEFAULT_INTERVAL_S
        self.at_s = t_s if t_s is not None else (self.at_s or 0.0) + dt
        if self.state is not None:
            self.state = predict(self.state, dt)
        result = super().estimate(image, trace, t_s, sun_camera)
        self.missed += not result.accepted
        if self.missed > MAX_COASTED_FRAMES:
            self.state = None
        return result

    def _estimate(self, record: StageRecord) -> PoseResult:
        frame = Observation.from_record(record)
        if self.state is not None:
            result = self._track(frame, self.state)
            if result is not None:
                return result
            frame.count("tracking_lost", 1)
        return self._initialise(frame)

    def _track(self, frame: Observation, state: TrackState) -> Optional[PoseResult]:
        """Return the tracked pose; None if the track is lost."""
        fit = self._align_on_edges(frame, state)
        if (
            fit is None
            or fit.n_inliers < MIN_EDGES
            or fit.rms_px > MAX_RMS_PX
            or fit.matched_share < MIN_MATCHED
        ):
            return None
        confidence = track_confidence(fit)
        q, t, covariance = fit.q, fit.t, fit.covariance
        edge_only_frames = self.edge_only_frames + 1
        is_doubtful = (
            confidence < CONFIDENT
            or edge_only_frames > MAX_EDGE_ONLY_FRAMES
            or largest_sigma(covariance[:3, :3]) > MAX_TILT_SIGMA_RAD
            or largest_sigma(state.P[:3, :3]) > MAX_PREDICTION_SIGMA_RAD
            or update(state, q, t, covariance)[1] > INNOVATION_95
        )
        prior, polarity = state, fit.polarity
        if is_doubtful and self.craft.model.faces is not None:
            q, t, covariance = self._align_photometrically(frame, state, fit)
            if quat.angle_rad(fit.q, q) > MAX_DISAGREEMENT_RAD or self._network_disagrees(frame, q, t):
                return None
            # edges that the image contradicts must not update the polarity used in the next frame
            if squared_distance(fit, q, t) > INNOVATION_95:
                polarity, edge_only_frames = self.polarity, MAX_EDGE_ONLY_FRAMES
            else:
                prior, edge_only_frames = update(state, fit.q, fit.t, fit.covariance)[0], 0
        distance = update(state, q, t, covariance)[1]
        posterior = update(prior, q, t, covariance)[0]
        if distance > INNOVATION_GATE or confidence < MIN_CONFIDENCE:
            return None
        self.state, self.polarity = posterior, polarity
        self.missed, self.edge_only_frames = 0, edge_only_frames
        frame.count("edges", fit.n_inliers)
        frame.mark("update")
        return PoseResult(
            True,
            "",
            posterior.q,
            posterior.t,
            confidence,
            frame.stages_ms,
            frame.counts,
            covariance=posterior.P[:6, :6],
            method=self.method,
        )

    def _align_on_edges(self, frame: Observation, state: TrackState) -> Optional[TrackFit]:
        """Return the predicted pose aligned on edges; None if it is too uncertain or the target too near."""
        craft, reach = self.craft, self._reach(state)
        # nearer, edges lie beside or behind the camera; chosen by eye
        if reach is None or state.t[2] < 1.2 * craft.radius_m:
            return None
        frame.mark("predict")
        frame.noise = self._noise(frame.image, state)
        frame.mark("noise")
        fit = track_edges(
            craft, frame.image, frame.noise, state.q, state.t, reach, self.polarity, empty=self.empty
        )
        frame.mark("edge_alignment")
        return fit

    def _align_photometrically(
        self, frame: Observation, state: TrackState, edges: TrackFit
    ) -> "tuple[Array, Array, Array]":
        """Return the pose aligned on the synthetic view, and its covariance.

        If only one face is lit, a pose aligned on edges drifts a little in each frame, with small residuals.
        """
        if self.empty:
            frame.background = float(np.median(self._strip(frame.image, state.t)))
        poses = ((state.q, state.t), (edges.q, edges.t))
        agree = quat.angle_rad(state.q, edges.q) < AGREEMENT_RAD
        self.photometric_alignments += 1
        sun = frame.sun_camera
        follow = sun is None and self.photometric_alignments % SUN_SEARCH_INTERVAL == 0
        track = align_photometrically(
            self.craft,
            frame,
            poses[1:] if agree else poses,
            self.sun if sun is None else sun,
            follow_sun=follow,
        )
        self.sun = track.sun
        frame.count("picture", 1)
        frame.mark("photometric_alignment")
        return track.fit.q, track.fit.t, track.fit.covariance

    def _network_disagrees(self, frame: Observation, q: Array, t: Array) -> bool:
        """Return True if the keypoint network prefers another pose."""
        learned = self.first.setup.learned
        if learned is None:
            return False
        deficit = learned.log_likelihood_deficit(frame.image, frame.noise, q, t)
        frame.mark("keypoint_network")
        return deficit > MAX_LOG_LIKELIHOOD_DEFICIT

    def _initialise(self, frame: Observation) -> PoseResult:
        result = self.first.initialise(frame)
        frame.count("initialised", 1)
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        # a declined pose may be a tilt that explains the image as well as the true one, so the filter does not take it
        if result.accepted and q is not None and t is not None:
            self.empty = isinstance(result.evidence, Evidence) and result.evidence.empty
            self._begin(q, t)
            self.sun = find_sun(self.craft, frame, (q, t))
            frame.mark("sun")
        return replace(result, method=self.method)

    def _begin(self, q: Array, t: Array) -> None:
        """Update the filter with an accepted initialisation.

        One that agrees with the prediction determines the rates; otherwise tracking restarts.
        """
        z = float(t[2])
        covariance = (
            np.diag([INITIAL_SIGMA_RAD] * 3 + [INITIAL_SIGMA_ACROSS * z] * 2 + [INITIAL_SIGMA_ALONG * z]) ** 2
        )
        self.missed = 0
        if self.state is not None:
            after, distance = update(self.state, q, t, covariance)
            if distance < INNOVATION_GATE:
                self.state = after
                return
        self.state = first_state(q, t, covariance)
        self.polarity = np.zeros(len(self.craft.samples))

    def _reach(self, state: TrackState) -> Optional[float]:
        """Return the search range of edges, three sigma of the prediction [px]; None if it is too large."""
        z = max(float(state.t[2]), self.craft.radius_m)
        f = 0.5 * (self.camera.fx_px + self.camera.fy_px)
        turn = float(np.sqrt(np.trace(state.P[:3, :3]) / 3)) * self.craft.radius_m
        across = float(np.sqrt(np.trace(state.P[3:5, 3:5]) / 2))
        along = float(np.sqrt(state.P[5, 5])) * self.craft.radius_m / z
        reach = 3.0 * f / z * float(np.sqrt(turn**2 + across**2 + along**2))
        return None if reach > MAX_REACH_PX else max(reach, MIN_REACH_PX)

    def _noise(self, image: Array, state: TrackState) -> float:
        """Return the noise around the target, measured on a strip of the image."""
        full_scale = 255.0 if image.dtype == np.uint8 else float(image.max())
        centre = quat.matrix(state.q) @ self.craft.centre_m + state.t
        return max(noise_sigma(self._strip(image, centre), full_scale), 0.15 * full_scale / 255)

    def _strip(self, image: Array, at_m: Array) -> Array:
        """Return 96 rows of the image around a point (3,), camera axes."""
        v = float(self.camera.pixels(at_m)[1])
        h = image.shape[0]
        y0 = int(np.clip(v - 48, 0, max(0, h - 96)))
        return image[y0 : y0 + 96]


def squared_distance(fit: TrackFit, q: Array, t: Array) -> float:
    """Return the squared Mahalanobis distance of a pose from one aligned on edges, by the latter's covariance."""
    error = innovation(first_state(fit.q, fit.t, fit.covariance), q, t)
    return float(error @ np.linalg.solve(fit.covariance, error))


def track_confidence(fit: TrackFit) -> float:
    """Return a confidence 0..1 from the share of samples with an edge, and the share with one within a pixel.

    A logistic function fitted on ``tango-flyaround``.
    """
    z = 14.0 * (fit.near_share - 0.33) + 8.0 * (fit.matched_share - 0.48) - max(0.0, fit.rms_px - 1.0)
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30))))
