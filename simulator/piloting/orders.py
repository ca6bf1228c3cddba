"""Commands of a pilot: a manual demand that is held, and orders that are carried out once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.chaser_control import BORESIGHT, GUARDS, UNGUIDED
from flyaround.simulator.piloting.control_laws import SWITCHES, Demand
from flyaround.simulator.piloting.docking_figures import PRESETS
from flyaround.simulator.piloting.readouts import mission_time, speed_text

if TYPE_CHECKING:
    from flyaround.simulator.piloting.chaser_control import AttitudeMode, Axes, Thrust
    from flyaround.simulator.piloting.control_laws import Switch
    from flyaround.simulator.piloting.docking_watch import News
    from flyaround.simulator.piloting.piloted_craft import PilotedCraft
    from flyaround.simulator.piloting.planned_burns import PlannedBurn
    from flyaround.simulator.world.guidance.keep_out import Guard


class Order(ABC):
    """An order, carried out once."""

    @abstractmethod
    def carry_out(self, craft: PilotedCraft) -> News | None:
        """Carry out the order.

        Returns
        -------
        News or None
            Answer to the pilot: severity and text; None if there is nothing to say.

        Raises
        ------
        UserError
            If the order is refused.
        """


@dataclass(frozen=True, kw_only=True)
class PilotCommand(Demand):
    """The command of one step: orders to carry out once, then a demand to hold.

    Parameters
    ----------
    orders : tuple of Order
        Orders in the sequence in which they are carried out.
    """

    orders: tuple[Order, ...] = ()


# --- control


@dataclass(frozen=True)
class TakeOver(Order):
    """Take over manual control from the chaser's state."""

    def carry_out(self, craft: PilotedCraft) -> None:
        """Take over, if guidance flies."""
        craft.take_over()


@dataclass(frozen=True)
class FollowGuidance(Order):
    """Return the chaser to the scenario's trajectory.

    Parameters
    ----------
    steered : bool
        True to continue under manual control from there.
    """

    steered: bool = False

    def carry_out(self, craft: PilotedCraft) -> News | None:
        """Return the chaser to the trajectory, if it is under manual control.

        Returns
        -------
        News or None
            Note of the distance by which the chaser is moved, a caution if a burn is planned; None under guidance.
        """
        if craft.steered is None:
            return None
        before = np.array(craft.steered.position_eci_m)
        craft.follow_guidance()
        moved_m = float(np.linalg.norm(craft.chaser.position_eci_m - before))
        if self.steered:
            craft.take_over()
        text = f"the chaser is put back onto the scenario's trajectory, {moved_m:.1f} m from where it was"
        return ("note", text) if self.steered else flown_news(craft, text, SCENARIOS)


# --- manual control


@dataclass(frozen=True)
class Control(Order):
    """Select how the pilot's demand acts; None leaves a setting unchanged.

    Parameters
    ----------
    axes : str, optional
        Axes of thrust: ``camera`` or ``lvlh``.
    thrust : str, optional
        ``continuous``, or one ``pulse`` for each switch that closes.
    attitude : str, optional
        Attitude mode: ``rate``, ``hold``, ``target`` or ``dock``.
    """

    axes: Axes | None = None
    thrust: Thrust | None = None
    attitude: AttitudeMode | None = None

    def carry_out(self, craft: PilotedCraft) -> None:
        """Apply the settings; an attitude mode takes over, and ``target`` begins along the boresight."""
        if self.attitude is not None:
            craft.set_attitude(self.attitude)
            craft.steering.aim = BORESIGHT
        craft.steering.axes = self.axes or craft.steering.axes
        craft.steering.thrust = self.thrust or craft.steering.thrust


@dataclass(frozen=True)
class Centre(Order):
    """Turn to the target and track it."""

    def carry_out(self, craft: PilotedCraft) -> None:
        """Track the target along the boresight."""
        craft.set_attitude("target")
        craft.steering.aim = BORESIGHT


@dataclass(frozen=True)
class Pulse(Order):
    """Give one pulse in a switch's direction."""

    switch: Switch

    def carry_out(self, craft: PilotedCraft) -> None:
        """Take over, and give the pulse.

        Raises
        ------
        UserError
            If the order cannot be carried out.
        """
        if self.switch not in SWITCHES:
            raise UserError(f"unknown switch {self.switch}, allowed: {', '.join(SWITCHES)}")
        craft.take_over()
        craft.steering.pulse(self.switch)


@dataclass(frozen=True)
class Stop(Order):
    """Brake to rest relative to the target in LVLH; rotation stops at once."""

    def carry_out(self, craft: PilotedCraft) -> None:
        """Take over, and brake."""
        craft.take_over()
        craft.steering.brake()


ABORTS = "abort: the chaser retreats from the target"
CLOSES_M_S = 0.001  # least closing speed that an abort beyond its distance names


@dataclass(frozen=True)
class Abort(Order):
    """Retreat from the target in the next step, at no more than real time; the camera tracks it."""

    def carry_out(self, craft: PilotedCraft) -> News:
        """Take over, and retreat; beyond the distance of a retreat, let the chaser drift.

        Returns
        -------
        News
            Warning that the chaser retreats, with the distance; a caution that it drifts if it is farther away already.
        """
        craft.take_over()
        steering, (p, v) = craft.steering, craft.state_lvlh()
        steering.abort()
        range_m, to_m = float(np.linalg.norm(p)), steering.retreat_to_m
        if range_m <= to_m:
            return "warning", f"{ABORTS} to {to_m:.3g} m; the camera tracks it"
        steering.aborting = False
        closing_m_s = -float(v @ p) / range_m
        where = f"it is {range_m:.1f} m away, and an abort retreats to {to_m:.3g} m"
        if closing_m_s >= CLOSES_M_S:
            where += f"; it closes at {speed_text(closing_m_s)}: Stop brakes it"
        return "caution", f"abort: guidance and burns end, and {UNGUIDED}: {where}"


# --- guidance and burns


@dataclass(frozen=True)
class Drift(Order):
    """End guidance and autopilot."""

    def carry_out(self, craft: PilotedCraft) -> News:
        """Take over, and let the chaser drift.

        Returns
        -------
        News
            Note that the chaser drifts.
        """
        craft.take_over()
        craft.steering.guide(None)
        return "note", "guidance: none, the chaser drifts"


SCENARIOS = "the scenario's guidance"
WOULD_TAKE_BACK = "would undo it"  # part of the caution that a guidance undoes a planned burn

WITH_IT = "the path with it"  # part of the caution that a planned burn leads into danger


def planned_text(burn: PlannedBurn) -> str:
    """Return the answer to the plan of a burn."""
    return f"a burn of {speed_text(burn.size_m_s)} is planned at {mission_time(burn.t_s)}"


def flown_news(craft: PilotedCraft, text: str, doing: str) -> News:
    """Return the answer to an order to fly a guidance.

    Parameters
    ----------
    craft : PilotedCraft
        The chaser, under that guidance.
    text : str
        Answer without a planned burn.
    doing : str
        Name of the guidance.

    Returns
    -------
    News
        Note of the guidance; a caution if a burn is planned, which the guidance would undo.
    """
    burns = craft.steering.burns.burns
    return _undone(burns[0], doing, f"{text}; ") if burns else ("note", text)


def _undone(burn: PlannedBurn, doing: str, begin: str = "") -> News:
    """Return the caution that a guidance would undo a burn."""
    return "caution", f"{begin}{planned_text(burn)}, but {doing} {WOULD_TAKE_BACK}: choose Free drift first"


def _planned_news(craft: PilotedCraft, burn: PlannedBurn) -> News:
    """Return the answer to a planned burn: a caution if guidance would undo it, or its path is dangerous."""
    text, doing = planned_text(burn), craft.steering.doing
    if doing:
        return _undone(burn, doing)
    risk = craft.burns_forecast()[1]
    return ("caution", f"{text}; {WITH_IT} {risk}") if risk else ("note", text)


@dataclass(frozen=True)
class PlanBurn(Order):
    """Plan a burn; one at the same time is replaced.

    Parameters
    ----------
    burn : PlannedBurn
        The burn.
    replaces_s : float, optional
        Time of a planned burn that it replaces.
    """

    burn: PlannedBurn
    replaces_s: float | None = None

    def carry_out(self, craft: PilotedCraft) -> News:
        """Take over, and add the burn to the plan.

        Returns
        -------
        News
            Note of size and time; a caution if the active guidance would undo the burn, or its path is dangerous.

        Raises
        ------
        UserError
            If `BurnPlan.with_burn` refuses the burn.
        """
        craft.take_over()
        steering = craft.steering
        others = steering.burns if self.replaces_s is None else steering.burns.without(self.replaces_s)
        steering.burns = others.with_burn(self.burn, craft.t_s)
        return _planned_news(craft, self.burn)


@dataclass(frozen=True)
class CancelBurns(Order):
    """Cancel the planned burn nearest to a time [s], or all of them."""

    t_s: float | None = None

    def carry_out(self, craft: PilotedCraft) -> News:
        """Remove the burn, or all of them, from the plan.

        Returns
        -------
        News
            Note of the number of cancelled burns, which may be 0.
        """
        before = craft.steering.burns
        craft.steering.burns = before.without(self.t_s)
        n = len(before.burns) - len(craft.steering.burns.burns)
        return "note", f"{n} planned burn{'s' * (n > 1)} cancelled" if n else "no burn was planned"


# --- docking

LIFTED = "the keep-out sphere is lifted: nothing keeps the chaser away from the target"


@dataclass(frozen=True)
class Approach(Order):
    """Switch the autopilot on or off; it flies to the next hold point and, after the last, into the port."""

    on: bool = True

    def carry_out(self, craft: PilotedCraft) -> News:
        """Engage the autopilot, or let the chaser drift.

        Returns
        -------
        News
            Note of the next destination, or that the autopilot is off; a caution if the keep-out sphere will stop it,
            or if a burn is planned.
        """
        if not self.on:
            craft.steering.guide(None)
            return "note", "the autopilot is off: the chaser drifts"
        craft.take_over()
        docking = craft.docking
        docking.hold_points.rearm(docking.figures(craft.chaser, craft.flight), docking.corridor_deg)
        craft.steering.engage_autopilot()
        point = docking.hold_points.next
        where = "the port" if point is None else f"{point.name}, {point.axial_m:g} m before the port"
        closed = craft.steering.guard == "scenario" and docking.closed_by(craft.flight, craft.t_s)
        news = flown_news(craft, f"the autopilot flies to {where}", craft.steering.doing)
        if not closed:
            return news
        if news[0] == "caution":
            # separate cautions, because each ends by itself
            craft.steering.news.append(news)
        return "caution", f"{closed}; the autopilot flies to {where}"


NO_POINT = "no hold point lies ahead, so Autopilot flies straight into the port"


@dataclass(frozen=True)
class Go(Order):
    """Let the chaser pass its hold point. Refused while a figure exceeds its limit."""

    def carry_out(self, craft: PilotedCraft) -> News:
        """Take over, and pass the point.

        Returns
        -------
        News
            Note of the point that the chaser may pass.

        Raises
        ------
        UserError
            If a figure exceeds its limit, or no hold point is left; the message lists the reasons.
        """
        docking, point = craft.docking, craft.docking.hold_points.next
        if point is None:
            raise UserError(f"Go has no effect: {NO_POINT}")
        figures = docking.figures(craft.chaser, craft.flight)
        against = docking.hold_points.go(figures, docking.limits, docking.corridor_deg)
        if against:
            raise UserError(f"no go at {point.name}: {'; '.join(against)}")
        craft.take_over()
        return "note", f"go at {point.name}"


@dataclass(frozen=True)
class NoGo(Order):
    """Keep the chaser at the next hold point."""

    def carry_out(self, craft: PilotedCraft) -> News:
        """Keep the chaser at the next hold point.

        Returns
        -------
        News
            Note of that point, or that there is none left.
        """
        point = craft.docking.hold_points.no_go()
        if point is None:
            return "note", f"No-go has no effect: {NO_POINT}"
        return "note", f"no-go: the chaser stays at {point.name}"


@dataclass(frozen=True)
class JudgeBy(Order):
    """Select the docking limits by the name of a preset."""

    preset: str

    def carry_out(self, craft: PilotedCraft) -> News:
        """Apply the limits.

        Returns
        -------
        News
            Note of the limits and their source.

        Raises
        ------
        UserError
            If there is no preset of that name.
        """
        if self.preset not in PRESETS:
            raise UserError(f"unknown limits {self.preset}, allowed: {', '.join(PRESETS)}")
        limits = craft.docking.limits = PRESETS[self.preset]
        return "note", f"limits: {limits.title} ({limits.source})"


@dataclass(frozen=True)
class GuardBy(Order):
    """Choose the corridor of the keep-out sphere, or lift the sphere.

    Parameters
    ----------
    guard : str
        ``scenario``: its own corridor; ``port``: a corridor that turns with the docking port; ``lifted``: no sphere.
    """

    guard: Guard

    def carry_out(self, craft: PilotedCraft) -> News:
        """Apply the choice.

        Returns
        -------
        News
            Note of the choice; a caution if the sphere is lifted.

        Raises
        ------
        UserError
            If the scenario has no sphere, or there is no such choice.
        """
        steering = craft.steering
        if self.guard not in GUARDS:
            raise UserError(f"unknown keep-out sphere {self.guard}, allowed: {', '.join(GUARDS)}")
        if steering.keep_out is None:
            raise UserError("this scenario has no keep-out sphere")
        steering.guard = self.guard
        if self.guard == "lifted":
            return "caution", LIFTED
        corridor = {"scenario": "as in the scenario", "port": "turns with the docking port"}[self.guard]
        return "note", f"keep-out sphere of {steering.keep_out.radius_m:g} m, corridor {corridor}"


@dataclass(frozen=True)
class TakeAxisHere(Order):
    """Dock along the line from the chaser through the target's centre of mass, fixed in the target."""

    def carry_out(self, craft: PilotedCraft) -> News:
        """Define the port where the line enters the target.

        Returns
        -------
        News
            Note that the docking axis has changed.
        """
        craft.docking.take_axis_here(craft.chaser, craft.flight)
        return "note", "the docking axis now leads from the chaser through the target's centre of mass"


# --- undo


Changes = dict[str, tuple[Any, Any]]
"""Values of the pilot's choices before and after a change, by field."""


@dataclass(frozen=True)
class Rechoose(Order):
    """Change some of the pilot's choices, as undo and redo do.

    Parameters
    ----------
    changes : dict of str to tuple
        Value before and after the change, by field of `PilotChoices`; of burns the difference counts.
    """

    changes: Changes

    def carry_out(self, craft: PilotedCraft) -> News | None:
        """Apply the choices; a burn that comes back takes over, as its plan does.

        Returns
        -------
        News or None
            Caution of a burn that comes back, or of the keep-out sphere if it is lifted; None without one.

        Raises
        ------
        UserError
            If a burn was flown or cancelled since, or can no longer be planned.
        """
        wanted = {name: after for name, (_, after) in self.changes.items()}
        before = craft.steering.burns
        if "burns" in wanted:
            wanted["burns"] = before.with_change(*self.changes["burns"], craft.t_s)
        craft.choices = replace(craft.choices, **wanted)
        news: list[News] = [("caution", LIFTED)] if wanted.get("guard") == "lifted" else []
        for burn in craft.steering.burns.burns:
            if burn not in before.burns:
                craft.take_over()
                news.append(_planned_news(craft, burn))
        return next((answer for answer in news if answer[0] == "caution"), None)
