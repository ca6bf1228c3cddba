"""The chaser's camera: the newest frame, letterboxed, with truth, crosshair and figures drawn over it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.gui import hover_text, style
from flyaround.gui.commands.timeline import clock
from flyaround.gui.picture.screen import exposure_fault, screen_picture
from flyaround.gui.picture.truth_overlay import Pixel
from flyaround.gui.views.docking_hud import DockingHud
from flyaround.gui.views.estimate_overlay import EstimateOverlay
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.views.mouse_steering import MouseSteering
from flyaround.gui.views.truth_marks import TruthMarks
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.picture.feed import Feed, Picture
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.session import FlightSession

FIGURES = {
    "UTC": "mid-exposure of this picture",
    "T+": "simulated time since the scenario's start [h:min:s], and how many times as fast as the clock it runs",
    "RANGE": "from the camera to the target's centre of mass",
    "CLOSING": "how fast the range shrinks; minus: it grows",
    "ACROSS": "speed across the line of sight, in the target's LVLH frame",
    "RATE": "how fast the target turns before the camera; Chaser has its three axes",
    "RADIAL": "chaser in the target's LVLH frame: outward from the Earth",
    "ALONG": "chaser in the target's LVLH frame: ahead along the orbit",
    "CROSS": "chaser in the target's LVLH frame: along the orbit's normal",
    "PHASE": "angle Sun, target, camera: at 0 the Sun stands behind the camera",
    "SUN": "share of the Sun's disc that the target sees past the Earth and the Moon",
}
BADGE = "what flies the chaser / how its attitude is kept"
SPEED = "pictures a second, what one costs (render and sensor), and its size in pixels"
PASSES = "what this pass of the renderer takes, median of five pictures; the bar is its share (F8)"


class CameraView(Panel):
    """Draws the picture and what is laid over it."""

    name, title, place, shown = "camera", "Chaser's camera", "centre", True
    bare = True

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._docking = DockingHud(window)
        self._mouse = MouseSteering(window)
        self._truth = TruthMarks(window)
        self._plates: list[tuple[float, float, float, float]] = []
        self._estimate = EstimateOverlay(window)
        self._judged_of: Picture | None = None
        self._judged = ""

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        imgui = self._imgui
        session, feed, options = console.session, console.feed, console.options
        place = self._free(1.0)
        draw = imgui.get_window_draw_list()
        picture = feed.newest
        if picture is None:
            name = session.plan.scenario.title or session.plan.scenario.name
            self._centred(
                draw,
                place,
                f"preparing {name}: {feed.late_s:.0f} s; the flight starts with its first picture",
            )
            return
        image = picture.frame.image
        box = Letterbox.fit((image.shape[1], image.shape[0]), place)
        size = (round(box.width), round(box.height))
        raw = options.overlays.raw
        view = f"{self.name}, raw" if raw else self.name
        screen = partial(screen_picture, picture.frame, raw=raw)
        texture = self._window.show_picture(view, picture, screen, size=size)
        left, top = round(box.x), round(box.y)
        draw.add_image(texture, imgui.ImVec2(left, top), imgui.ImVec2(left + size[0], top + size[1]))
        self._mouse.take(box, console)
        draw.push_clip_rect(
            imgui.ImVec2(box.x, box.y), imgui.ImVec2(box.x + box.width, box.y + box.height), True
        )
        # names stay clear of where the figures stood the last time
        taken, self._plates = tuple(self._plates), []
        self._truth.draw(box, picture, options, paused=session.clock.paused, taken=taken)
        if options.overlays.estimate:
            self._estimate.draw(draw, box, picture, console.jobs.estimates)
        # the docking display has a cross and figures of its own
        if options.overlays.crosshair and not options.overlays.docking:
            self._truth.crosshair(box, picture)
        if options.overlays.docking:
            self._docking.draw(box, console, picture)
        draw.pop_clip_rect()
        if options.overlays.hud:
            self._hud(draw, place, session, feed, picture)
        if options.overlays.times:
            self._times(draw, place, feed)
        if picture is not self._judged_of:
            self._judged_of, self._judged = picture, exposure_fault(picture.frame)
        if self._judged and not feed.late_s:
            self._notice(draw, place, self._judged)
        if feed.late_s:
            self._veil(draw, place, f"picture of {feed.late_s:.0f} s ago; the next is being prepared")

    def _veil(self, draw: Any, place: tuple[float, float, float, float], text: str) -> None:  # noqa: ANN401
        """Darken what is not the present, and say so."""
        corner = self._vec((place[0] + place[2], place[1] + place[3]))
        draw.add_rect_filled(self._vec((place[0], place[1])), corner, self._color(style.PLATE))
        self._centred(draw, place, text)

    def _notice(self, draw: Any, place: tuple[float, float, float, float], text: str) -> None:  # noqa: ANN401
        """Say something at the top of the view, between the corners' figures."""
        width = self._imgui.calc_text_size(text).x
        at = (place[0] + (place[2] - width) / 2, place[1] + 14 + 2 * self._line)
        self._plate(draw, at, width, 1)
        self._text(draw, at, text, style.WARN)

    def _hud(
        self,
        draw: Any,  # noqa: ANN401
        place: tuple[float, float, float, float],
        session: FlightSession,
        feed: Feed,
        picture: Picture,
    ) -> None:
        imgui = self._imgui
        x, y, width, height = place
        r = picture.telemetry
        imgui.push_font(self._window.figure_font, 0.0)
        line = self._line
        rate = float(np.linalg.norm(r.relative_rate_deg_s))
        left = (
            ("UTC", f"{r.epoch_utc.replace('T', ' ')[:23].rstrip('Z')}", style.INK),
            (
                "T+",
                f"{clock(r.t_s)[2:]}   x{session.clock.rate:g}",
                style.WARN if session.clock.paused else style.INK,
            ),
        )
        bottom = (
            ("RANGE", f"{r.range_m:10.3f} m", style.ACCENT),
            ("CLOSING", f"{r.closing_m_s:+10.4f} m/s", style.INK),
            ("ACROSS", f"{r.lateral_m_s:10.4f} m/s", style.INK),
            ("RATE", f"{rate:10.3f} deg/s", style.INK),
        )
        lit = style.GOOD if r.sun_visible_fraction > 0 else style.BAD
        right = (
            ("RADIAL", f"{r.position_lvlh_m[0]:+10.3f} m", style.INK),
            ("ALONG", f"{r.position_lvlh_m[1]:+10.3f} m", style.INK),
            ("CROSS", f"{r.position_lvlh_m[2]:+10.3f} m", style.INK),
            ("PHASE", f"{r.phase_deg:10.1f} deg", style.INK),
            ("SUN", f"{100 * r.sun_visible_fraction:10.0f} %", lit),
        )
        column = imgui.calc_text_size("CLOSING +99999.999 deg").x
        # in a small view the figures that matter most
        tall, wide = height > line * (len(left) + len(right) + 3), width > 2 * column + 64
        if tall and wide:
            self._column(draw, (x + 16, y + 14), left)
        self._column(draw, (x + 16, y + height - 14 - line * len(bottom)), bottom)
        if wide:
            self._column(draw, (x + width - 16 - column, y + height - 14 - line * len(right)), right)
        badge, color = _badge(session)
        image = picture.frame.image
        speed = f"{feed.frame_ms:.0f} ms  {image.shape[1]}x{image.shape[0]}"
        if not session.clock.paused:
            speed = f"{feed.frames_s:.1f} fps  {speed}"
        widest = max(imgui.calc_text_size(badge).x, imgui.calc_text_size(speed).x)
        self._plate(draw, (x + width - 16 - widest, y + 14), widest, 2)
        self._text(draw, (x + width - 16 - imgui.calc_text_size(badge).x, y + 14), badge, color)
        self._text(draw, (x + width - 16 - imgui.calc_text_size(speed).x, y + 14 + line), speed, style.QUIET)
        self._tip((x + width - 16 - widest, y + 14), (widest, line), BADGE)
        self._tip((x + width - 16 - widest, y + 14 + line), (widest, line), SPEED)
        imgui.pop_font()

    def _times(self, draw: Any, place: tuple[float, float, float, float], feed: Feed) -> None:  # noqa: ANN401
        """Each pass's time with a bar as long as its share of the picture's."""
        imgui = self._imgui
        imgui.push_font(self._window.figure_font, 0.0)
        rows = shown_passes(feed.pass_ms)
        total = sum(ms for _, ms in rows)
        rows = (*rows, ("picture", total)) if rows else (("timing the passes ...", 0.0),)
        step, number = (imgui.calc_text_size(t).x for t in ("target geometry  ", "9999.9 ms "))
        bar = 7.0 * self._line
        x, y = place[0] + 16, place[1] + 14 + 3 * self._line
        self._plate(draw, (x, y), step + number + bar, len(rows))
        for k, (name, ms) in enumerate(rows):
            at = y + k * self._line
            self._text(draw, (x, at), name, style.QUIET)
            self._tip((x, at), (step + number + bar, self._line), PASSES)
            if total <= 0:
                continue
            self._text(draw, (x + step, at), f"{ms:6.1f} ms", style.INK)
            left, top = x + step + number, at + 0.25 * self._line
            color = style.WARN if name == "picture" else style.ACCENT
            draw.add_rect_filled(
                self._vec((left, top)),
                self._vec((left + max(bar * ms / total, 1.0), top + 0.45 * self._line)),
                self._color((*color[:3], 0.85)),
            )
        imgui.pop_font()

    def _column(self, draw: Any, at: Pixel, rows: tuple[tuple[str, str, style.Rgba], ...]) -> None:  # noqa: ANN401
        x, y = at
        step = self._imgui.calc_text_size("CLOSING ").x
        width = step + max(self._imgui.calc_text_size(value).x for _, value, _ in rows)
        self._plate(draw, at, width, len(rows))
        for k, (name, value, color) in enumerate(rows):
            self._text(draw, (x, y + k * self._line), name, style.QUIET)
            self._text(draw, (x + step, y + k * self._line), value, color)
            self._tip((x, y + k * self._line), (width, self._line), FIGURES[name])

    def _tip(self, corner: Pixel, size: Pixel, text: str) -> None:
        # what is drawn in letters of figures is told in the panels' own
        self._imgui.push_font(self._window.text_font, 0.0)
        hover_text.tell_place(self._imgui, corner, size, text)
        self._imgui.pop_font()

    def _plate(self, draw: Any, at: Pixel, width: float, lines: int) -> None:  # noqa: ANN401
        """A dark ground under figures, which must be read over a sunlit cloud deck too."""
        corner = (at[0] + width + 8, at[1] + lines * self._line + 3)
        self._plates.append((at[0] - 8, at[1] - 6, corner[0] - at[0] + 8, corner[1] - at[1] + 6))
        draw.add_rect_filled(
            self._vec((at[0] - 8, at[1] - 6)), self._vec(corner), self._color(style.PLATE), 4.0
        )

    @property
    def _line(self) -> float:
        return float(self._imgui.get_text_line_height_with_spacing())

    def _text(self, draw: Any, at: Pixel, text: str, color: style.Rgba, *, shadow: bool = True) -> None:  # noqa: ANN401
        if shadow:
            draw.add_text(self._vec((at[0] + 1, at[1] + 1)), self._color((0.0, 0.0, 0.0, 0.85)), text)
        draw.add_text(self._vec(at), self._color(color), text)

    def _centred(self, draw: Any, place: tuple[float, float, float, float], text: str) -> None:  # noqa: ANN401
        size = self._imgui.calc_text_size(text)
        at = (place[0] + (place[2] - size.x) / 2, place[1] + (place[3] - size.y) / 2)
        self._text(draw, at, text, style.INK)

    def _vec(self, p: Pixel) -> Any:  # noqa: ANN401
        return self._imgui.ImVec2(p[0], p[1])

    def _color(self, rgba: style.Rgba) -> int:
        return int(self._imgui.color_convert_float4_to_u32(self._imgui.ImVec4(*rgba)))


def shown_passes(stage_ms: dict[str, float]) -> tuple[tuple[str, float], ...]:
    """Names for people and times [ms] of the passes that took any, in the order they run; without the sums."""
    passes = [(name.removeprefix("render."), ms) for name, ms in stage_ms.items() if "." in name]
    if not passes:
        return ()
    rest = stage_ms.get("render", 0.0) - sum(ms for _, ms in passes)
    rows = [*passes, ("other", rest), ("sensor", stage_ms.get("sensor", 0.0))]
    return tuple((name.replace(".", " "), ms) for name, ms in rows if ms >= 0.05)


def _badge(session: FlightSession) -> tuple[str, style.Rgba]:
    steering = session.craft.steering
    if session.craft.mode == "guidance":
        badge, color = "GUIDANCE", style.ACCENT
    else:
        attitude = "TRACK" if session.craft.tracking else steering.attitude.upper()
        axes = " LVLH" if steering.axes == "lvlh" else ""
        badge = f"{(steering.doing or 'steer').upper()}{axes} / {attitude}{' / BRAKE' if steering.braking else ''}"
        color = style.ACCENT if steering.doing else style.WARN
        if steering.guarded:
            badge, color = f"{badge} / KEEP OUT", style.BAD
    if session.clock.jump:
        badge = f"JUMP  {badge}"
    if session.look_back.active:
        badge, color = f"LOOKING BACK  {badge}", style.WARN
    return (f"PAUSED  {badge}" if session.clock.paused else badge), color
