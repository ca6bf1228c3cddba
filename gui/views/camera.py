"""The view of the chaser's camera: the newest picture, with truth, crosshair and figures over or beside it."""

from __future__ import annotations

from functools import partial
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.picture.figures import AGE_TIP, FIGURES, age_text, flown_colour
from flyaround.gui.picture.label_placement import is_free
from flyaround.gui.picture.screen import exposure_fault, screen_picture
from flyaround.gui.texts import texts
from flyaround.gui.views.docking_hud import DockingHud
from flyaround.gui.views.estimate_overlay import draw_estimates
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.views.mouse_steering import MouseSteering
from flyaround.gui.views.truth_marks import TruthMarks
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.readouts import duration_text, mission_time

if TYPE_CHECKING:
    from flyaround.gui.canvas import Place
    from flyaround.gui.console import Console
    from flyaround.gui.picture.feed import Feed, Picture
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.session import FlightSession

MARGIN, LEAST_GAP, WIDEST_GAP = 12.0, 8.0, 140.0
"""Margin between figures and the edge of the view, and between columns, in screen units."""
TIPS = texts("view-tips")
BARS = 30  # strokes of the bar of a whole picture's time
LEAST_LETTERS = 12  # of a line of the mode
NAME = "PICTURE "
"""Longest name of a figure, for the column width."""


class Row(NamedTuple):
    """A figure over the view: name, value, colour and hover text."""

    name: str
    value: str
    colour: style.Rgba
    tip: str


Groups = tuple[tuple[Row, ...], ...]


class CameraView(Panel):
    """The picture with its overlays and figures."""

    name, title, place, shown = "camera", "Chaser's camera", "centre", True
    bare = True

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._docking = DockingHud(window)
        self._mouse = MouseSteering(window)
        self._truth = TruthMarks(window)
        self._plates: list[Place] = []
        self._metered: Picture | None = None
        self._fault = ""

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        session, feed, options = console.session, console.feed, console.options
        place, canvas = self._free(1.0), Canvas(self._window)
        picture = feed.newest
        if picture is None:
            name = session.plan.scenario.title or session.plan.scenario.name
            canvas.centred(place, name, f"{console.preparing}, {duration_text(feed.late_s)} so far")
            return
        groups = self._groups(console, picture) if options.overlays.hud else ()
        image = picture.frame.image
        box, beside = self._placed(canvas, place, (image.shape[1], image.shape[0]), groups)
        raw = options.overlays.raw
        view = f"{self.name}, raw" if raw else self.name
        screen = partial(screen_picture, picture.frame, raw=raw)
        canvas.picture(view, picture, screen, (box.x, box.y, box.width, box.height))
        self._mouse.take(box, console)
        canvas.clip((box.x, box.y), (box.width, box.height))
        # names avoid the figures' positions in the last frame
        taken, self._plates = tuple(self._plates), []
        self._truth.draw(box, picture, options, paused=session.clock.paused, obstacles=taken)
        if options.overlays.estimate:
            self._plates += draw_estimates(canvas, box, picture, console.jobs)
        # the docking display has its own cross and figures
        if options.overlays.crosshair and not options.overlays.docking:
            self._truth.crosshair(box, picture)
        if options.overlays.docking:
            self._docking.draw(box, console, picture)
            self._plates += self._docking.plates
        canvas.unclip()
        within = (box.x, box.y, box.width, box.height)
        if beside is None:
            if groups and options.overlays.docking:
                # without the date, for the docking display's figures at the upper edge
                utc = groups[1][0]._replace(value=groups[1][0].value.split()[-1])
                groups = groups[0], (utc, *groups[1][1:]), *groups[2:]
            self._corners(canvas, within if box.width > 0.75 * place[2] else place, groups)
        else:
            self._in_columns(canvas, beside, groups)
        if options.overlays.times:
            self._times(canvas, within, feed, self._line * (3.5 if beside is None else 0))
        if picture is not self._metered:
            self._metered, self._fault = picture, exposure_fault(picture.frame)
        if feed.late_s:
            canvas.box(within[:2], within[2:], style.PLATE)
            text = f"no new picture for {duration_text(feed.late_s)}"
            canvas.centred(within, text, console.preparing)
        elif self._fault:
            width = canvas.size(self._fault)[0]
            x, y = box.x + (box.width - width) / 2, box.y + box.height - 1.5 * self._line
            # the lowest place at which it covers no figure
            while y > box.y and not is_free((x - 8, y - 6, width + 16, self._line + 9), self._plates):
                y -= self._line / 4
            self._write(canvas, (x, y), (Row("", self._fault, style.WARN, ""),))

    # --- arrangement

    def _placed(
        self, canvas: Canvas, place: Place, image: tuple[int, int], groups: Groups
    ) -> tuple[Letterbox, Place | None]:
        """Return the place of the picture, and that of figures beside it; None if they lie over it.

        The picture is as large as the view allows; free space below or at the right holds the figures.
        """
        x, y, width, height = place
        box = Letterbox.fit(image, place)
        across, down = width - box.width, height - box.height
        self._push()
        widths = [self._width(canvas, rows) for rows in _columns(groups)]
        self._imgui.pop_font()
        deep = self._line * max((len(rows) for rows in _columns(groups)), default=0) + MARGIN
        tall = self._line * sum(len(rows) for rows in groups) + 2 * MARGIN
        if groups and down >= deep and sum(widths) + 2 * MARGIN + 2 * LEAST_GAP <= width:
            top = Letterbox(box.x, y, box.width, box.height, box.scale)
            return top, (x, y + box.height, width, down)
        if groups and across >= max(widths) + 2 * MARGIN and height >= tall:
            left = Letterbox(x, box.y, box.width, box.height, box.scale)
            return left, (x + box.width, y, across, height)
        return box, None

    def _in_columns(self, canvas: Canvas, place: Place, groups: Groups) -> None:
        """Draw the figures in columns below the picture, or stacked beside it."""
        self._push()
        columns = _columns(groups)
        widths = [self._width(canvas, rows) for rows in columns]
        below = sum(widths) + 2 * MARGIN + 2 * LEAST_GAP <= place[2]
        gap = min((place[2] - sum(widths) - 2 * MARGIN) / 2, WIDEST_GAP)
        x, y = place[0] + MARGIN, place[1] + MARGIN / 2
        for rows, width in zip(columns, widths, strict=True):
            self._write(canvas, (x, y), rows, plate=False)
            x, y = (x + width + gap, y) if below else (x, y + len(rows) * self._line)
        self._imgui.pop_font()

    def _corners(self, canvas: Canvas, place: Place, groups: Groups) -> None:
        """Draw the figures over the picture's corners; in a small view only the most important."""
        if not groups:
            return
        x, y, width, height = place
        self._push()
        flying, moment, motion, right = groups
        column = self._width(canvas, right)
        tall = height > self._line * (len(moment) + len(right) + 3)
        wide = width > 2 * column + 64
        low = y + height - MARGIN
        room = width - 2 * MARGIN
        if tall and wide and moment:
            self._write(canvas, (x + MARGIN, y + MARGIN), moment)
            room -= self._width(canvas, moment) + 3 * MARGIN
        self._write(canvas, (x + MARGIN, low - self._line * len(motion)), motion)
        if wide:
            self._write(canvas, (x + width - MARGIN - column, low - self._line * len(right)), right)
        flying = self._folded(canvas, flying, room)
        at = (x + width - MARGIN - self._width(canvas, flying), y + MARGIN)
        self._write(canvas, at, flying)
        self._imgui.pop_font()

    # --- figures

    @staticmethod
    def _groups(console: Console, picture: Picture) -> Groups:
        """Return figures by subject: control, time, motion, position and light."""
        session, feed, image, r = console.session, console.feed, picture.frame.image, console.telemetry
        badge, colour = mode_badge(session)
        speed = f"{feed.frame_ms:.0f} ms  {image.shape[1]}x{image.shape[0]} px"
        rate = "" if session.clock.paused else f"{feed.frames_s:.1f} fps  "
        turning = f"{float(np.linalg.norm(r.relative_rate_deg_s)):9.3f} °/s"
        age = age_text(session, picture.frame.scene.t_s, 0.0)
        running = style.WARN if session.clock.paused else style.INK

        def row(name: str, colour: style.Rgba = style.INK) -> Row:
            figure = FIGURES[name.capitalize()]
            return Row(name, figure.form.format(*figure.values(r)), colour, figure.tip)

        def lvlh(name: str, metres: float) -> Row:
            return Row(name, f"{metres:+z9.3f} m", style.INK, TIPS[name])

        utc = r.epoch_utc.replace("T", " ")[:23].rstrip("Z")
        t = f"{mission_time(r.t_s)[2:]}   {session.clock.rate:g}x"
        sun = style.GOOD if r.sun_visible_fraction > 0 else style.BAD
        flying = Row("", badge, colour, TIPS["badge"]), Row("", rate + speed, style.QUIET, TIPS["speed"])
        times = Row("UTC", utc, style.INK, TIPS["utc"]), Row("T+", t, running, TIPS["time"])
        turn = Row("RATE", turning, style.INK, TIPS["rate"])
        motion = row("RANGE", style.ACCENT), row("CLOSING"), row("ACROSS"), turn, row("PHASE")
        place = map(lvlh, ("RADIAL", "ALONG", "CROSS"), r.position_lvlh_m)
        frame = Row("", "IN TARGET'S LVLH", style.QUIET, TIPS["frame"])
        where = frame, *place, row("SUN", sun)
        return flying, (*times, Row("PICTURE", *age, AGE_TIP)), motion, where

    def _write(
        self, canvas: Canvas, at: tuple[float, float], rows: tuple[Row, ...], *, plate: bool = True
    ) -> None:
        """Draw figures one below the other, over the picture on a dark plate."""
        x, y = at
        step = canvas.size(NAME)[0]
        width = self._width(canvas, rows)
        if plate:
            ground = (x - 8, y - 6, width + 16, len(rows) * self._line + 9)
            self._plates.append(ground)
            canvas.box(ground[:2], ground[2:], style.PLATE, 4.0)
        for k, row in enumerate(rows):
            top = y + k * self._line
            canvas.plain_text((x, top), row.name, style.QUIET, row.tip)
            canvas.plain_text((x + step if row.name else x, top), row.value, row.colour, row.tip)

    def _times(self, canvas: Canvas, place: Place, feed: Feed, below: float) -> None:
        """Draw each pass's time with a bar proportional to its share."""
        self._push()
        passes = shown_passes(feed.pass_ms)
        total = sum(ms for _, ms in passes)
        rows = [*passes, ("picture", total)] if total else []
        texts = [f"{n:16s} {ms:7.1f} ms  {'|' * round(BARS * ms / total):{BARS}}" for n, ms in rows]
        tip = "median of five pictures, and its share (F8)"
        lines = tuple(Row("", text, style.INK, tip) for text in texts or ["timing the passes ..."])
        self._write(canvas, (place[0] + MARGIN, place[1] + MARGIN + below), lines)
        self._imgui.pop_font()

    @staticmethod
    def _folded(canvas: Canvas, rows: tuple[Row, ...], room: float) -> tuple[Row, ...]:
        """Return figures without names in lines of at most a width, broken before the mode if they are wider."""
        letters = max(int(room / canvas.size("0")[0]), LEAST_LETTERS)
        folded = []
        for row in rows:
            parts = (row.value,) if len(row.value) <= letters else row.value.rpartition("  ")
            folded += [row._replace(value=line) for part in parts for line in wrap(part, letters)]
        return tuple(folded)

    def _push(self) -> None:
        """Use the font of figures until ``pop_font``."""
        self._imgui.push_font(self._window.figure_font, 0.0)

    @staticmethod
    def _width(canvas: Canvas, rows: tuple[Row, ...]) -> float:
        """Return the width of figures one below the other."""
        return max(canvas.size(NAME + row.value if row.name else row.value)[0] for row in rows)

    @property
    def _line(self) -> float:
        return float(1.12 * self._imgui.get_text_line_height())


def _columns(groups: Groups) -> list[tuple[Row, ...]]:
    """Return the groups as columns: control above time."""
    return [(*groups[0], *groups[1]), *groups[2:]] if groups else []


def shown_passes(stage_ms: dict[str, float]) -> tuple[tuple[str, float], ...]:
    """Return names and times [ms] of the passes that ran, in order, without sums."""
    passes = [(name.removeprefix("render."), ms) for name, ms in stage_ms.items() if "." in name]
    if not passes:
        return ()
    rest = stage_ms.get("render", 0.0) - sum(ms for _, ms in passes)
    rows = [*passes, ("other", rest), ("sensor", stage_ms.get("sensor", 0.0))]
    return tuple((name.replace(".", " ").replace("_", " "), ms) for name, ms in rows if ms >= 0.05)


def mode_badge(session: FlightSession) -> tuple[str, style.Rgba]:
    """Return what flies the chaser, as the view names it, and its colour."""
    steering = session.craft.steering
    if session.craft.mode == "guidance":
        badge, color = "GUIDANCE", style.ACCENT
    else:
        attitude = steering.attitude_text.upper()
        axes = " LVLH" if steering.axes == "lvlh" else ""
        badge = f"{(steering.doing or 'steer').upper()}{axes} / {attitude}{' / BRAKE' if steering.braking else ''}"
        color = flown_colour(session, style.WARN)
        if steering.guarded:
            badge, color = f"{badge} / KEEP OUT", style.BAD
    if session.clock.jump:
        badge = f"JUMP  {badge}"
    if session.look_back.replays:
        badge, color = "REPLAY", style.WARN
    elif session.look_back.active:
        badge, color = f"LOOKING BACK  {badge}", style.WARN
    return (f"PAUSED  {badge}" if session.clock.paused else badge), color
