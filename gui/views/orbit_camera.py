"""The free camera's view: drag to rotate, scroll to zoom, double-click to reset."""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas, point
from flyaround.gui.picture.figures import AGE_TIP, age_text
from flyaround.gui.picture.further import ORBIT_CAMERA
from flyaround.gui.picture.label_placement import place_labels
from flyaround.gui.picture.orbit_camera import ABOUT, FARTHEST_M, NEAREST_M, OrbitCamera
from flyaround.gui.picture.orbit_picture import TRAIL_POINTS, ChaserMarks, chaser_marks
from flyaround.gui.picture.screen import screen_picture
from flyaround.gui.texts import texts
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.docking_port import radius_m

if TYPE_CHECKING:
    from flyaround.gui.canvas import Place
    from flyaround.gui.console import Console
    from flyaround.gui.picture.feed import Picture

DEGREES_PER_UNIT = 0.4  # turn per unit of mouse movement
WHEEL_FACTOR = 1.15  # change of the distance per step of the wheel
MARKED_BELOW_UNITS = 14.0
"""Projected diameter of the target [screen units] below which it is marked: the height of a letter."""

NAMED_BELOW_UNITS = 48.0
"""Projected diameter of the target [screen units] below which it is named."""


class OrbitCameraView(Panel):
    """Target and chaser from outside, by the same renderer; the chaser as axes and frustum of its camera."""

    name, title, place, shown = ORBIT_CAMERA, "Orbit camera", "bottom", False
    bare = True

    _turned_from: OrbitCamera | None = None
    _marks: ChaserMarks | None = None
    _marks_of: Picture | None = None

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        imgui = self._imgui
        look = console.options.orbit
        place = self._free(32.0)
        look.fill(place[2], place[3])
        look.follow(console.session.craft.world.range_m)
        imgui.set_next_item_allow_overlap()
        imgui.invisible_button("orbit", self._w.vec(place[2], place[3]))
        self._mouse(console)
        canvas = Canvas(self._window)
        feed = console.feeds.get(ORBIT_CAMERA)
        if feed is not None:
            feed.look()
        if feed is None or (picture := feed.newest) is None:
            canvas.centred(place, console.preparing)
            return
        image = picture.frame.image
        box = Letterbox.fit((image.shape[1], image.shape[0]), place)
        canvas.clip(place[:2], place[2:])
        screen = partial(screen_picture, picture.frame)
        canvas.picture(self.name, picture, screen, (box.x, box.y, box.width, box.height))
        self._chaser(canvas, box, self._marks_for(console, picture), self._target(canvas, box, picture))
        where = f"azimuth {look.azimuth_deg:.0f}°, elevation {look.elevation_deg:.0f}°, {look.distance_m:.1f} m away"
        text = f"about {look.about}: {where}"
        canvas.text((place[0] + 8, place[1] + 6), text, tip=texts("view-tips")["orbit"])
        age, colour = age_text(console.session, picture.frame.scene.t_s)
        rate = f"{image.shape[1]}x{image.shape[0]} px  {feed.frames_s:.0f} fps  {age}"
        if place[3] > 6 * canvas.line:
            below = (place[0] + 8, place[1] + 6 + canvas.line)
            tip = f"pixels of this view's picture, and pictures a second\n{AGE_TIP if age else ''}".strip()
            canvas.text(below, rate, colour if age else style.QUIET, tip)
        canvas.unclip()
        self._buttons(console, place)

    def _marks_for(self, console: Console, picture: Picture) -> ChaserMarks:
        if self._marks is None or self._marks_of is not picture:
            session, world = console.session, picture.state.world
            trail = session.look_back.path(world)
            trail = trail[:: max(1, len(trail) // TRAIL_POINTS)]
            frame = session.flight.lvlh(world.t_s)
            camera = session.plan.camera
            self._marks = chaser_marks(picture.frame.scene, world, camera, frame, trail)
            self._marks_of = picture
        return self._marks

    def _target(self, canvas: Canvas, box: Letterbox, picture: Picture) -> list[Place]:
        """Name the target, and mark it if its bounding sphere is smaller on the screen than a letter.

        Returns
        -------
        list of Place
            What the chaser's name must leave free: the target with its name, if it has one.
        """
        scene, target = picture.frame.scene, picture.target
        x, y, z = scene.camera_from_target.apply(np.array(target.mass.com_m))
        if z <= 0:
            return []
        place, half = box.at(point(scene.camera.project([x, y, z]))), radius_m(target) / z
        half *= box.scale * scene.camera.fx_px
        if 2 * half < MARKED_BELOW_UNITS:
            canvas.diamond(place, 4.0, style.WARN)
        if 2 * half >= NAMED_BELOW_UNITS:
            return []
        half, (wide, high) = max(half, 4.0), canvas.size("target")
        at = (place[0] + half + 4, place[1] + 4)
        canvas.text(at, "target", style.WARN)
        return [(place[0] - half, place[1] - half, 2 * half + wide + 10, 2 * half + high + 6)]

    def _chaser(self, canvas: Canvas, box: Letterbox, marks: ChaserMarks, named: list[Place]) -> None:
        canvas.stroke(box.all_at(marks.trail), (*style.ACCENT[:3], 0.9), 1.5)
        for line in box.all_at(marks.frustum):
            canvas.stroke(line, style.INK, 1.2)
        for line, colour in zip(box.all_at(marks.axes), style.AXIS_COLORS, strict=True):
            canvas.stroke(line, colour, 2.4)
        x, y = point(box.all_at(marks.place))
        if box.x < x < box.x + box.width and box.y < y < box.y + box.height:
            canvas.dot((x, y), 3.0, style.ACCENT)
            # below the two lines at the top
            top, size = 6 + 2 * canvas.line, canvas.size("chaser")
            within = (box.x, box.y + top, box.width, box.height - top)
            for label in filter(None, place_labels([(x, y)], [size], within, obstacles=named)):
                canvas.stroke([(x, y), label.lead or (x, y)], style.ACCENT, 1.0)
                canvas.text(label.corner, "chaser", style.ACCENT)
        else:
            away = f"the chaser is out of view, {marks.range_m:.0f} m away: Reset view"
            at = (box.x + 8, box.y + box.height / 2)
            canvas.text(at, away, style.WARN, "distance from the free camera; Reset view brings it into view")

    def _buttons(self, console: Console, place: tuple[float, float, float, float]) -> None:
        """Draw the buttons for object and initial position, in the lower left corner."""
        imgui, look = self._imgui, console.options.orbit
        height = imgui.get_frame_height()
        if place[3] < 5 * height:
            return
        imgui.set_cursor_screen_pos(self._w.vec(place[0] + 8, place[1] + place[3] - height - 8))
        for k, about in enumerate(ABOUT):
            if k:
                imgui.same_line()
            title, on = about.capitalize(), look.about == about
            self._w.button(console, "orbit-camera.about", about, label=title, on=on)
        imgui.same_line()
        self._w.button(console, "orbit-camera.reset", label="Reset view")

    def _mouse(self, console: Console) -> None:
        """Rotate and zoom at once. A drag is one command, at its end; each event of the wheel is one, too."""
        imgui, look = self._imgui, console.options.orbit
        io = imgui.get_io()
        if imgui.is_item_hovered():
            if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
                console.do("orbit-camera.reset")
                return
            if io.mouse_wheel:
                factor = WHEEL_FACTOR**io.mouse_wheel
                do_place(console, look.azimuth_deg, look.elevation_deg, look.distance_m / factor)
        if imgui.is_item_active() and imgui.is_mouse_dragging(imgui.MouseButton_.left, 2.0):
            self._turned_from = self._turned_from or copy(look)
            right, down = (DEGREES_PER_UNIT * d for d in (io.mouse_delta.x, io.mouse_delta.y))
            look.place(look.azimuth_deg + right, look.elevation_deg + down, look.distance_m)
        elif self._turned_from is not None:
            # the command is the change that is undone
            console.options.orbit, self._turned_from = self._turned_from, None
            do_place(console, look.azimuth_deg, look.elevation_deg, look.distance_m)


def do_place(console: Console, azimuth_deg: float, elevation_deg: float, distance_m: float) -> None:
    """Run the command of the camera's place, in tenths of a degree and whole centimetres."""
    distance_m = min(max(distance_m, NEAREST_M), FARTHEST_M)
    console.do("orbit-camera.place", round(azimuth_deg, 1), round(elevation_deg, 1), round(distance_m, 2))
