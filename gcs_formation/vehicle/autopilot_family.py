"""What the station requires of an autopilot of any family; all differences are in subclasses."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandInt, CommandLong, ParamValue
from airlink.messages.system import Heartbeat
from flight_model.autopilot_model import FlightState, Setpoint
from flight_model.earth import GeodeticOrigin
from formation_scenario.model import PathPlan
from formation_scenario.orders import End
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.telemetry import Telemetry

STATION_SYSTEM: Final = 255
"""Our own system id."""
AIRBORNE_M: Final = 10.0
"""Height above its home from which an armed vehicle flies, whatever it says."""
NO_MODE: Final = -1
"""A mode that no heartbeat shows, not even one that hasn't come."""
SLOW_RATE_HZ: Final = 2.0
UTC_RATE_HZ: Final = 1.0
ASKED_S: Final = 30.0
"""Longest wait for the answer to a request: of 43 tries, with half of all datagrams lost either way, some are all lost
in four starts of a million."""
FAILSAFE_IS_OVER: Final = ("off", "cleared", "regained")
"""Words of texts that say so."""
Command = CommandLong | CommandInt
KnownSetpoints = list[CommandInt | None]
"""What a vehicle has been told of airspeed, heading and height; None where it must be told again."""


class Effect(NamedTuple):
    """What heartbeats show once a vehicle has carried out a command."""

    description: str
    shown: Callable[[Telemetry], int | None]
    """Reads from telemetry what the command changes: the mode, or whether the vehicle is armed."""
    expected: int


def nothing(_: Telemetry) -> tuple[Command, ...]:
    """Return no command."""
    return ()


@dataclass(frozen=True)
class StartUpStep:
    """One step of getting a vehicle ready: commands until `done` holds, within `timeout_s`."""

    name: str
    done: Callable[[Telemetry], bool]
    commands: Callable[[Telemetry], tuple[Command, ...]] = nothing
    """Returns what to send, by the telemetry of the instant at which the step begins."""
    timeout_s: float = 20.0
    every_command_acknowledged: bool = False
    """Then each of them has `timeout_s` of its own."""
    takes_off: bool = False
    """Whether its commands bring a vehicle off the ground."""

    def acts(self, seen: Telemetry) -> bool:
        """Return whether its commands change what the vehicle does, not only what it tells."""
        return any(command.command != m.MAV_CMD_SET_MESSAGE_INTERVAL for command in self.commands(seen))


class Autopilot(ABC):
    """Speaks one family's language to one vehicle."""

    family: ClassVar[str]
    """Name of the family, for messages."""
    loop_s: ClassVar[float]
    """Period of the autopilot's main loop, on which it answers, s."""
    take_off_m: ClassVar[float]
    """Height above home at which a take-off is complete, m."""
    take_off_mode: ClassVar[int] = NO_MODE
    """In which it takes off; `NO_MODE`: in the guided mode."""
    taken_off_mode: ClassVar[int] = NO_MODE
    """That follows its take-off by itself."""
    loiter_mode: ClassVar[int]
    home_mode: ClassVar[int]
    """In which its failsafe flies home."""
    guided_mode: ClassVar[int]
    mode_names: ClassVar[dict[int, str]]
    setpoint_commands: ClassVar[tuple[int, ...]]
    """Id of the command that carries airspeed, that of heading and that of height, each acknowledged; none where
    setpoints are other messages, which nobody acknowledges."""
    fast_messages: ClassVar[tuple[int, ...]] = (
        m.MAVLINK_MSG_ID_ATTITUDE,
        m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        m.MAVLINK_MSG_ID_VFR_HUD,
    )
    """Messages with its motion, asked for at the scenario's rate."""
    slow_messages: ClassVar[tuple[int, ...]] = (m.MAVLINK_MSG_ID_SYS_STATUS,)
    """What else is asked for, at `SLOW_RATE_HZ`: `vehicle.telemetry` keeps it."""
    unasked_hz: ClassVar[dict[int, float]] = {m.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
    """Messages that are sent without a request, and their rates, Hz."""
    setpoints_set_mode: ClassVar[bool] = False
    """Whether each setpoint also commands the guided mode, and so undoes a pilot's choice of another."""
    acknowledges_early: ClassVar[bool] = False
    """Whether it acknowledges a change of mode before it has decided on it: heartbeats alone are to be believed."""
    circling_mode: ClassVar[int] = NO_MODE
    """In which it turns onto a circle, clockwise by default, as soon as it is told."""
    stands_after_s: ClassVar[float] = math.inf
    """How long after the last setpoint it stands; infinite where it flies on, or leaves the mode by its failsafe."""
    returns_after_s: ClassVar[float] = 0.0
    """How long after the last setpoint it sets off for home at the latest, for want of setpoints; 0: it doesn't."""
    stands: ClassVar[bool] = False
    """Whether it stands where it waits, and needs no height of its own there; others circle."""
    flies_courses: ClassVar[bool] = False
    """Whether a fixed wing is told courses over ground instead of headings."""
    approach_m: ClassVar[float] = 0.0
    """Height above home of the approach that `land` begins with."""
    failsafe_words: ClassVar[tuple[str, ...]] = ("failsafe",)
    """When a failsafe acts, what it says (STATUSTEXT) has one of these words in it."""

    def __init__(
        self,
        system: int,
        origin: GeodeticOrigin,
        turn_rate_max_rps: float,
        airspeed_scale: AirspeedScale | None = None,
    ) -> None:
        """Address `system`; places and heights count from the scenario's `origin`.

        With an `airspeed_scale` airspeeds are converted between true ones and its sensor's readings, in which it tells
        them and is told them; without one they are true.
        """
        self._guided_mode: int = self.guided_mode
        self.system = system
        self.origin = origin
        self.turn_rate_max_rps = turn_rate_max_rps
        self.airspeed_scale = airspeed_scale

    def stand_in(self) -> tuple[Message, ...]:
        """Return what to send in place of a setpoint, to a family that must hear some to be commanded."""
        return ()

    def forget_setpoints(self) -> None:
        """Take note that something else than setpoints has led it meanwhile."""
        return  # most remember nothing of setpoints

    def tells_failsafe(self, text: str) -> bool:
        """Return whether a text of its own says that a failsafe acts, not that it is over."""
        said = text.lower()
        over = any(word.strip(".:,;!") in FAILSAFE_IS_OVER for word in said.split())
        return not over and any(word in said for word in self.failsafe_words)

    def mode_name(self, telemetry: Telemetry) -> str:
        """Return the vehicle's mode in words."""
        mode = telemetry.custom_mode
        return "unknown" if mode is None else self.mode_names.get(mode, f"mode {mode}")

    def takes_setpoints(self, telemetry: Telemetry) -> bool:
        """Whether the vehicle is in the mode in which it follows setpoints, armed and flying."""
        mode = telemetry.custom_mode
        return telemetry.armed and mode is not None and mode == self._guided_mode and self.is_airborne(telemetry)

    def effect(self, command: Command) -> Effect | None:
        """Return what heartbeats show once a command is carried out, None when they don't show it."""
        mode = self.mode_asked(command)
        if mode is not None:
            return Effect(f"mode {self.mode_names.get(mode, mode)}", _mode, mode)
        if command.command == m.MAV_CMD_COMPONENT_ARM_DISARM:
            arm = bool(command.param1)
            return Effect("arming" if arm else "disarming", _armed, arm)
        return None

    def mode_asked(self, command: Command) -> int | None:
        """Return the mode, as heartbeats tell it, that a command asks for; None if it asks for none."""
        return int(command.param2) if command.command == m.MAV_CMD_DO_SET_MODE else None

    def set_mode(self, mode: int) -> Command:
        """Return MAV_CMD_DO_SET_MODE for one of the family's own modes."""
        return self._command(m.MAV_CMD_DO_SET_MODE, m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)

    def set_message_interval(self, message_id: int, rate_hz: float) -> Command:
        """Return MAV_CMD_SET_MESSAGE_INTERVAL."""
        return self._command(m.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, round(1e6 / rate_hz))

    def home_request(self) -> Command:
        """Return the request for its home."""
        return self._command(m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_HOME_POSITION)

    def requests(self, rates_hz: Mapping[int, float]) -> tuple[Command, ...]:
        """Return the requests for those messages that don't come by themselves."""
        return tuple(self.set_message_interval(i, rates_hz[i]) for i in rates_hz if i not in self.unasked_hz)

    @abstractmethod
    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is of this family; in others the same mode numbers mean other modes."""

    def rates_hz(self, telemetry_rate_hz: float, *, utc: bool = False) -> Mapping[int, float]:
        """Return the rate, Hz, of each message that we need, including those sent without a request.

        Those that carry its motion have `telemetry_rate_hz`; `utc`: its UTC is needed.
        """
        fast, slow = self.fast_messages, self.slow_messages
        rates_hz = dict.fromkeys(fast, telemetry_rate_hz) | dict.fromkeys(slow, SLOW_RATE_HZ) | self.unasked_hz
        return rates_hz | {m.MAVLINK_MSG_ID_SYSTEM_TIME: UTC_RATE_HZ} if utc else rates_hz

    @property
    def start_up_modes(self) -> frozenset[int]:
        """The modes in which its start-up leads it."""
        return frozenset({self.take_off_mode, self.taken_off_mode, self.guided_mode})

    @abstractmethod
    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps from first contact to following setpoints in the air; the first asks for messages."""

    @abstractmethod
    def is_airborne(self, telemetry: Telemetry) -> bool:
        """Whether the vehicle flies, by its own account."""

    @abstractmethod
    def says_grounded(self, telemetry: Telemetry) -> bool:
        """Whether the vehicle says that it stands on the ground, wherever it is."""

    def is_grounded(self, telemetry: Telemetry) -> bool:
        """Return whether it certainly stands on the ground: disarmed, or it says so, and from a place that agrees."""
        if telemetry.heartbeat is None or telemetry.boots:
            return False
        at_home = telemetry.motion is not None and self.says_grounded(telemetry)
        return not telemetry.armed or (at_home and not self.is_airborne(telemetry))

    def climbs_out(self, telemetry: Telemetry) -> bool:
        """Return whether a fixed wing is taking off, below the height at which that ends."""
        motion = telemetry.motion
        if motion is None or telemetry.stands:
            return False
        return telemetry.custom_mode == self.take_off_mode and motion.above_home_m <= self.take_off_m

    def _is_taking_off(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) or seen.custom_mode == self.take_off_mode

    @property
    def speeds_mps(self) -> tuple[float, float] | None:
        """The lowest and the highest true airspeed that it can reach soon, m/s; None where they are its model's."""
        return None if self.airspeed_scale is None else self.airspeed_scale.speeds_mps

    def true_airspeed(self, told_mps: float) -> float:
        """Return the true airspeed, m/s, of one that it tells."""
        return told_mps if self.airspeed_scale is None else self.airspeed_scale.true(told_mps)

    def airspeed_to_tell(self, true_mps: float) -> float:
        """Return what it must be told to fly a true airspeed, m/s."""
        return true_mps if self.airspeed_scale is None else self.airspeed_scale.reading(true_mps)

    @abstractmethod
    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return the messages that carry a setpoint, which acts when the vehicle is in that state."""

    def news(self, setpoint: Setpoint, where: FlightState, known: KnownSetpoints) -> list[Message]:  # noqa: ARG002 - of most
        """Return the messages of a setpoint that say more than what the vehicle knows; most must hear all of them."""
        return list(self.setpoint(setpoint, where))

    @abstractmethod
    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the parameters to read before a vehicle that is taken for this `model` flies such a path."""

    def parameter(self, reported: ParamValue) -> float:
        """Return a parameter's value from the message that tells it."""
        return reported.param_value

    def stand_down(self) -> tuple[Command, ...]:
        """Return the commands that keep a vehicle on the ground; one that flies refuses them."""
        return (self._arm_or_disarm(arm=False),)

    def _to_arm(self, _: Telemetry) -> tuple[Command, ...]:
        return (self._arm_or_disarm(arm=True),)

    def _arm_or_disarm(self, *, arm: bool) -> Command:
        return self._command(m.MAV_CMD_COMPONENT_ARM_DISARM, float(arm))

    def _command(self, command: int, *params: float) -> CommandLong:
        """Return a command to its autopilot, with the first of its parameters."""
        return CommandLong(self.system, m.MAV_COMP_ID_AUTOPILOT1, command, 0, *params)

    def leave(self, manner: End, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return the commands that end a flight: circle here or, for `rtl` and before `land`, at home."""
        return self.loiter(height_m, seen) if manner == "loiter" else self.go_home(height_m, seen)

    def land(self) -> tuple[Command, ...]:
        """Return the commands to land where the vehicle took off; none for a family that can't."""
        return ()

    def hold(self) -> tuple[Command, ...]:
        """Return the command to circle or stand where it is, at the height that it has."""
        return (self.set_mode(self.loiter_mode),)

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - of what lands there
        """Return the commands, in order, to fly home, and circle there at `height_m` above the scenario's origin.

        What stands flies at its own height, or at its parameters' if that is higher, and lands there.
        """
        return (self.set_mode(self.home_mode),)

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - of what stands
        """Return the commands, in order, to circle where it was `seen` at `height_m` above the scenario's origin."""
        return self.hold()


def _mode(seen: Telemetry) -> int | None:
    return seen.custom_mode


def _armed(seen: Telemetry) -> bool | None:
    return seen.armed if seen.heartbeat else None
