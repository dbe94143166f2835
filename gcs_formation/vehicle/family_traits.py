"""What is constant of an autopilot family: its modes, the messages that it needs, and how it behaves."""

from __future__ import annotations

import math
from typing import ClassVar, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m

NO_MODE: Final = -1
"""A mode that no heartbeat shows; differs from None, which is the mode before the first heartbeat."""


@mypyc_attr(allow_interpreted_subclasses=True)
class FamilyTraits:
    """The constants of a family; a family's class gives its own."""

    family: ClassVar[str]
    """Name of the family, for messages."""
    loop_s: ClassVar[float]
    """Period of the autopilot's main loop, on which it answers, s."""
    take_off_m: ClassVar[float]
    """Height above home at which a take-off is complete, m."""
    take_off_mode: ClassVar[int] = NO_MODE
    """Mode in which it takes off; `NO_MODE`: the guided mode."""
    taken_off_mode: ClassVar[int] = NO_MODE
    """Mode that it enters by itself after take-off."""
    loiter_mode: ClassVar[int]
    home_mode: ClassVar[int]
    """Mode in which its failsafe flies home."""
    guided_mode: ClassVar[int]
    failsafe_parameters: ClassVar[tuple[str, ...]] = ()
    """The parameters that say what it does when the ground station is silent."""
    mode_names: ClassVar[dict[int, str]]
    unarmable_modes: ClassVar[frozenset[int]] = frozenset()
    """Modes in which it may not be armable, however ready it is: another is set before that is waited for."""
    setpoint_commands: ClassVar[tuple[int, ...]]
    """Ids of the commands that carry airspeed, heading and height, each acknowledged; empty for a family whose
    setpoints are other messages, without acknowledgement."""
    fast_messages: ClassVar[tuple[int, ...]] = (
        m.MAVLINK_MSG_ID_ATTITUDE,
        m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        m.MAVLINK_MSG_ID_VFR_HUD,
    )
    """Motion messages, requested at the scenario's rate."""
    slow_messages: ClassVar[tuple[int, ...]] = (m.MAVLINK_MSG_ID_SYS_STATUS,)
    """Other messages that `vehicle.telemetry` needs, requested at `SLOW_RATE_HZ`."""
    start_up_messages: ClassVar[tuple[int, ...]] = (m.MAVLINK_MSG_ID_SYS_STATUS,)
    """Those of them that are read before take-off only; in flight they come rarely."""
    unasked_hz: ClassVar[dict[int, float]] = {m.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
    """Messages that the autopilot sends without a request, and their rates, Hz."""
    setpoints_set_mode: ClassVar[bool] = False
    """Whether each setpoint also commands the guided mode, and so overrides a mode that a pilot has chosen."""
    acknowledges_early: ClassVar[bool] = False
    """Whether it acknowledges a change of mode before deciding on it, so that only heartbeats are reliable."""
    circling_mode: ClassVar[int] = NO_MODE
    """Mode in which it enters a circle at once, clockwise by default."""
    hovers_after_s: ClassVar[float] = math.inf
    """Time from the last setpoint until it hovers, s; infinite if it flies on, or changes mode by its failsafe."""
    returns_after_s: ClassVar[float] = 0.0
    """Longest time from the last setpoint until its failsafe sends it home, s; 0: it has no such failsafe."""
    tells_time_with_home: ClassVar[bool] = False
    """Whether HOME_POSITION, which comes on request, has its time since boot, as TIMESYNC has."""
    hovers: ClassVar[bool] = False
    """Whether it hovers where it waits, and so needs no loiter height of its own as circling vehicles do."""
    flies_courses: ClassVar[bool] = False
    """Whether a fixed wing is commanded by course over ground instead of heading."""
    approach_m: ClassVar[float] = 0.0
    """Height above home at which the approach of `land` begins, m, unless a parameter or its mission says another."""
    approach_parameter: ClassVar[str] = ""
    """The parameter that says so, m; "" if none does."""
    lands_by_mission: ClassVar[bool] = False
    """Whether it flies the landing of its stored mission on MAV_CMD_DO_LAND_START."""
    landing_is_marked: ClassVar[bool] = True
    """Whether such a landing begins at DO_LAND_START alone."""
    mounting_parameter: ClassVar[str] = "AHRS_ORIENTATION"
    """Parameter that says how the autopilot is mounted in its aircraft."""
    failsafe_words: ClassVar[tuple[str, ...]] = ("failsafe",)
    """Words of which one is in the STATUSTEXT that reports a failsafe's action."""
