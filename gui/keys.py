"""The key map: what each key does, by the names Dear ImGui gives keys; no window is needed to read it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from simulator.runtime.arrays import Vec3


class Action(Enum):
    """Everything a key can do."""

    FORWARD = auto()
    BACK = auto()
    LEFT = auto()
    RIGHT = auto()
    UP = auto()
    DOWN = auto()
    PITCH_UP = auto()
    PITCH_DOWN = auto()
    YAW_LEFT = auto()
    YAW_RIGHT = auto()
    ROLL_LEFT = auto()
    ROLL_RIGHT = auto()
    COARSE = auto()
    FINE = auto()
    STOP = auto()
    TRACK = auto()
    CENTRE = auto()
    HOLD_STEER = auto()
    RESET = auto()
    PAUSE = auto()
    STEP = auto()
    FASTER = auto()
    SLOWER = auto()
    RESTART = auto()
    HELP = auto()
    PANEL = auto()
    HUD = auto()
    TIMES = auto()
    CROSSHAIR = auto()
    KEYPOINTS = auto()
    BOX = auto()
    AXES = auto()
    WIREFRAME = auto()
    SCREENSHOT = auto()
    FULL_SCREEN = auto()
    CLOSE_HELP = auto()


# Directions along camera axes: x right, y down, z forward.
THRUST: dict[Action, Vec3] = {
    Action.FORWARD: (0.0, 0.0, 1.0),
    Action.BACK: (0.0, 0.0, -1.0),
    Action.LEFT: (-1.0, 0.0, 0.0),
    Action.RIGHT: (1.0, 0.0, 0.0),
    Action.UP: (0.0, -1.0, 0.0),
    Action.DOWN: (0.0, 1.0, 0.0),
}
# Right-handed turns of the camera about its axes: about +x the nose goes up, about +y it goes right.
TURN: dict[Action, Vec3] = {
    Action.PITCH_UP: (1.0, 0.0, 0.0),
    Action.PITCH_DOWN: (-1.0, 0.0, 0.0),
    Action.YAW_LEFT: (0.0, -1.0, 0.0),
    Action.YAW_RIGHT: (0.0, 1.0, 0.0),
    Action.ROLL_LEFT: (0.0, 0.0, -1.0),
    Action.ROLL_RIGHT: (0.0, 0.0, 1.0),
}
STEERING = frozenset(THRUST) | frozenset(TURN)
GAINS = frozenset({Action.COARSE, Action.FINE})
HELD = STEERING | GAINS


@dataclass(frozen=True)
class Binding:
    """Keys of one action.

    Parameters
    ----------
    keys : names as in ``imgui.Key``. shown : the same for people. what : what it does.
    """

    group: str
    action: Action
    keys: tuple[str, ...]
    shown: str
    what: str


BINDINGS: tuple[Binding, ...] = (
    Binding("Translation (hold)", Action.FORWARD, ("w",), "W", "thrust forward, along the boresight"),
    Binding("Translation (hold)", Action.BACK, ("s",), "S", "thrust back"),
    Binding("Translation (hold)", Action.LEFT, ("a",), "A", "thrust left"),
    Binding("Translation (hold)", Action.RIGHT, ("d",), "D", "thrust right"),
    Binding("Translation (hold)", Action.UP, ("r",), "R", "thrust up in the picture"),
    Binding("Translation (hold)", Action.DOWN, ("f",), "F", "thrust down in the picture"),
    Binding("Rotation (hold)", Action.PITCH_UP, ("i", "up_arrow"), "I / Up", "pitch up"),
    Binding("Rotation (hold)", Action.PITCH_DOWN, ("k", "down_arrow"), "K / Down", "pitch down"),
    Binding("Rotation (hold)", Action.YAW_LEFT, ("j", "left_arrow"), "J / Left", "yaw left"),
    Binding("Rotation (hold)", Action.YAW_RIGHT, ("l", "right_arrow"), "L / Right", "yaw right"),
    Binding("Rotation (hold)", Action.ROLL_LEFT, ("u",), "U", "roll left"),
    Binding("Rotation (hold)", Action.ROLL_RIGHT, ("o",), "O", "roll right"),
    Binding(
        "Steering", Action.COARSE, ("left_shift", "right_shift"), "Shift", "five times as strong, while held"
    ),
    Binding("Steering", Action.FINE, ("left_ctrl", "right_ctrl"), "Ctrl", "a fifth as strong, while held"),
    Binding("Steering", Action.STOP, ("x",), "X", "stop: brake to rest beside the target (LVLH)"),
    Binding("Steering", Action.TRACK, ("t",), "T", "track: the attitude follows the target, on or off"),
    Binding("Steering", Action.CENTRE, ("c",), "C", "bring the target to the middle and track it"),
    Binding("Steering", Action.HOLD_STEER, ("g",), "G", "scenario's guidance / steering by hand"),
    Binding("Steering", Action.RESET, ("home",), "Home", "reset: back onto the scenario's trajectory"),
    Binding("Time", Action.PAUSE, ("space",), "Space", "pause or go on"),
    Binding("Time", Action.STEP, ("period",), ".", "one frame (paused)"),
    Binding("Time", Action.FASTER, ("equal", "keypad_add", "right_bracket"), "+ / ]", "faster"),
    Binding("Time", Action.SLOWER, ("minus", "keypad_subtract", "left_bracket"), "- / [", "slower"),
    Binding("Time", Action.RESTART, ("backspace",), "Backspace", "restart from the beginning"),
    Binding("Display", Action.HELP, ("f1", "h"), "F1 / H", "this list"),
    Binding("Display", Action.KEYPOINTS, ("f2",), "F2", "keypoints"),
    Binding("Display", Action.BOX, ("f3",), "F3", "bounding box"),
    Binding("Display", Action.AXES, ("f4",), "F4", "target axes"),
    Binding("Display", Action.WIREFRAME, ("f5",), "F5", "wireframe"),
    Binding("Display", Action.CROSSHAIR, ("f6",), "F6", "crosshair"),
    Binding("Display", Action.HUD, ("f7",), "F7", "figures over the view"),
    Binding("Display", Action.TIMES, ("f8",), "F8", "time of each pass"),
    Binding("Display", Action.PANEL, ("tab",), "Tab", "side panel"),
    Binding("Display", Action.FULL_SCREEN, ("f11",), "F11", "full screen"),
    Binding("Display", Action.SCREENSHOT, ("p", "f12"), "P / F12", "save picture and truth to out/console"),
    Binding("Display", Action.CLOSE_HELP, ("escape",), "Esc", "close this list"),
)
