"""Poses aligned side by side on the picture: those that fall behind or become another one are left."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np

from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.geometry.faces import Faces
from hil.board.svd.geometry.image_patch import ImagePatch
from hil.board.svd.geometry.shading import Shading
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.model.rasteriser import draw_faces, order_faces
from hil.board.svd.model.shadow_map import Sunlight
from hil.board.svd.native.backend import accelerated
from hil.board.svd.native.raster import shadow_map as native
from hil.board.svd.refine.photometric import PhotoFit, explained, photo_draw, photo_step
from hil.board.svd.refine.shadows import shadowed

Array = np.ndarray

# How far apart poses are that are compared [rad].
SPREAD_RAD = float(np.radians(6.0))

# An alignment that leaves the size it started from by more has gone astray: logarithm of the range.
ASTRAY = 0.3

# Poses nearer than this to a better one end where it does: 30 of 30 pairs within 0.4 deg, 20 mm [rad, share of range].
SAME_RAD, SAME_SHARE = float(np.radians(1.0)), 0.03

# Poses about another that lean to another side, and how far [rad].
LEANING, LEANING_RAD = 6, float(np.radians(12.0))

# What of a score is noise where all are low.
SLACK = 0.02


@dataclass(frozen=True, eq=False)
class Ranked:
    """A pose aligned on the picture, its score, its start, and which faces its canvas shows there, where kept."""

    score: float
    fit: PhotoFit
    start: Candidate
    seen: Optional[Array] = None

    def candidate(self) -> Candidate:
        """The aligned pose with the evidence of its start."""
        return Candidate(self.fit.q, self.fit.t, self.start.support, self.start.field, self.start.region)


@dataclass(frozen=True)
class Left:
    """Which of the poses that are aligned side by side go on.

    Parameters
    ----------
    share : of the best score that the others must have. apart_rad : how far from every better one they must be.
    most : how many at most.
    """

    share: float
    apart_rad: float
    most: int = 1000

    def of(self, courses: List[Course]) -> Tuple[List[Course], List[Course]]:
        """Those that go on, the best first, and those whose score says enough; what nearly is a better one is gone."""
        going: List[Course] = []
        stay: List[Course] = []
        for c in sorted(courses, key=lambda c: -c.score):
            if going and (c.score < self.share * going[0].score - SLACK or len(going) >= self.most):
                stay.append(c)
            elif all(_differ(c.fit, o.fit, self.apart_rad) for o in going):
                going.append(c)
        return going, stay


@dataclass(frozen=True, eq=False)
class Course:
    """A pose on its way to where the picture wants it, drawn where it is now.

    Parameters
    ----------
    start : where it began. fit : where it is. shading, score : the craft drawn there, and how well it explains
        the picture. sun : casts shadows; None draws none.
    """

    start: Candidate
    fit: PhotoFit
    shading: Shading
    score: float
    sun: Optional[Sunlight] = None


# Courses that were drawn on one canvas, by where they were and what was done.
Known = Dict[Tuple[Any, ...], Course]


def faces_of(craft: PreparedTarget) -> Faces:
    """Faces of a target that has them."""
    faces = craft.model.faces
    assert faces is not None  # noqa: S101 - the caller asked
    return faces


def begin(craft: PreparedTarget, canvas: ImagePatch, c: Candidate, known: Optional[Known] = None) -> Course:
    """A candidate drawn where it is, without shadows."""

    def drawn() -> Course:
        shading = photo_draw(c.q, c.t, faces_of(craft), canvas, craft.camera.pinhole)
        return Course(c, PhotoFit(c.q, c.t, 9.9, np.eye(6)), shading, explained(shading, canvas))

    return _once(known, ("begun", c.q.tobytes(), c.t.tobytes()), c, drawn)


def with_shadows(
    craft: PreparedTarget, canvas: ImagePatch, course: Course, known: Optional[Known] = None
) -> Course:
    """A course that has just begun, with the shadows that the picture wants there."""
    q, t = course.fit.q, course.fit.t

    def lit() -> Course:
        drawn = shadowed(craft, faces_of(craft), canvas, q, t, course.shading, coarse=True)
        return Course(course.start, course.fit, drawn.shading, drawn.score, drawn.sun)

    return _once(known, ("lit", q.tobytes(), t.tobytes()), course.start, lit)


def _once(
    known: Optional[Known], key: Tuple[Any, ...], start: Candidate, made: Callable[[], Course]
) -> Course:
    """A course of ``start`` as it is known already, or as it is ``made`` and then known."""
    if known is None:
        return made()
    if key not in known:
        known[key] = made()
    return replace(known[key], start=start)


def align_together(
    craft: PreparedTarget,
    canvas: ImagePatch,
    courses: List[Course],
    blurs: Tuple[float, ...],
    left: Tuple[Left, ...],
    known: Optional[Known] = None,
) -> List[Ranked]:
    """Poses aligned side by side on a canvas and scored by it, the best first.

    Parameters
    ----------
    blurs : of each step. left : who goes on with it; the others stay where they are, with the score they have.
    known : courses of the same canvas from before; receives these.
    """
    done: List[Course] = []
    for blur, keep in zip(blurs, left):  # noqa: B905 - Python 3.9 has no strict=
        going, stay = keep.of(courses)
        done += stay
        courses = []
        for c in going:
            key = (c.fit.q.tobytes(), c.fit.t.tobytes(), c.sun, blur)
            on = _once(known, key, c.start, partial(_moved, craft, canvas, c, blur))
            moved = on.fit.q.tolist() != c.fit.q.tolist() or on.fit.t.tolist() != c.fit.t.tolist()
            (courses if moved else done).append(on)
    out = []
    for c in (*courses, *done):
        astray = abs(np.log(max(c.fit.t[2], 1e-3) / max(c.start.t[2], 1e-3))) > ASTRAY
        out.append(Ranked(0.5 * c.score if astray else c.score, c.fit, c.start, c.shading.seen))
    return sorted(out, key=lambda r: -r.score)


def _moved(craft: PreparedTarget, canvas: ImagePatch, c: Course, blur: float) -> Course:
    """A course one step on; itself where the picture says nothing."""
    faces, camera = faces_of(craft), craft.camera.pinhole
    fit = photo_step(c.fit, c.shading, faces, canvas, camera, craft.radius_m, blur)
    if fit is None:
        return c
    shading = photo_draw(fit.q, fit.t, faces, canvas, camera, c.sun)
    return Course(c.start, fit, shading, explained(shading, canvas), c.sun)


def apart(ranked: List[Ranked]) -> List[Ranked]:
    """Poses without those that are nearly one that comes before."""
    out: List[Ranked] = []
    for r in ranked:
        if all(_differ(r.fit, o.fit, SAME_RAD) for o in out):
            out.append(r)
    return out


def led(r: Ranked, starts: Sequence[Ranked]) -> bool:
    """Whether a pose nearly is one of those that were followed to their ends: it ends where that does."""
    return any(r is o or not _differ(r.fit, o.fit, SAME_RAD) for o in starts)


def _differ(fit: PhotoFit, better: PhotoFit, apart_rad: float) -> bool:
    """Whether a pose is another one than a better one: turned by more, or elsewhere."""
    away = fit.t - better.t
    elsewhere = away.dot(away) > SAME_SHARE**2 * better.t.dot(better.t)
    return bool(elsewhere or quat.angle_rad(fit.q, better.q) > apart_rad)


def leaning(craft: PreparedTarget, c: Candidate) -> List[Candidate]:
    """Poses tilted against one to every side, about axes across the line of sight; the centre stays in its place."""
    centre = quat.matrix(c.q) @ craft.centre_m + c.t
    sight = centre / np.linalg.norm(centre)
    across = np.cross(sight, np.eye(3)[int(np.argmin(np.abs(sight)))])
    across /= np.linalg.norm(across)
    out = []
    for angle in 2 * np.pi * np.arange(LEANING) / LEANING:
        axis = np.cos(angle) * across + np.sin(angle) * np.cross(sight, across)
        q = quat.normalise(quat.multiply(quat.from_rotvec(LEANING_RAD * axis), c.q))
        t = centre - quat.matrix(q) @ craft.centre_m
        out.append(Candidate(q, t, c.support, c.field, c.region, c.likely))
    return out


def laid_over(
    craft: PreparedTarget, canvas: ImagePatch, twins: List[Candidate], held: Candidate
) -> List[Candidate]:
    """Poses moved across the line of sight until their outlines have their middles where that of ``held`` has its own.

    A twin turned about the centre of the craft's sphere lies beside the picture where an antenna or a panel moves that
    centre off the middle of what is seen: by 27 px of 200 for a half turn of Tango, which then was never found.
    """
    middle = _middle(craft, canvas, held)
    out = []
    for c in twins:
        shift = middle - _middle(craft, canvas, c)
        depth = float((quat.matrix(c.q) @ craft.centre_m + c.t)[2])
        across = np.array([shift[0] / craft.camera.fx_px, shift[1] / craft.camera.fy_px, 0.0]) * depth
        out.append(replace(c, t=c.t + across) if np.isfinite(across).all() else c)
    return out


def _middle(craft: PreparedTarget, canvas: ImagePatch, c: Candidate) -> Array:
    """(2,) middle of what a pose covers of the canvas [picture px]; NaN where that is nothing."""
    faces, R = faces_of(craft), quat.matrix(c.q)
    seen = draw_faces(faces, order_faces(faces, -R.T @ c.t), craft.camera.pinhole, R, c.t, canvas)
    return _mean_pixel(seen) / canvas.scale


@accelerated(native.mean_pixel)
def _mean_pixel(seen: Array) -> Array:
    """(2,) mean column and row of the pixels that show the craft; NaN where none does."""
    rows, columns = np.nonzero(seen)
    return np.array([columns.mean(), rows.mean()]) if len(rows) else np.full(2, np.nan)


def spread_out(pool: List[Course], keep: int, before: Sequence[Candidate] = ()) -> List[Course]:
    """The first that differ in attitude from each other and from where those ``before`` began."""
    out: List[Course] = []
    for c in pool:
        if len(out) >= keep:
            break
        taken = [b.q for b in before] + [o.fit.q for o in out]
        if all(quat.angle_rad(c.fit.q, q) > SPREAD_RAD for q in taken):
            out.append(c)
    return out
