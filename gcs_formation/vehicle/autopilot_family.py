"""What the station requires of an autopilot of any family; all differences are in subclasses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.endpoint import ComponentId
from airlink.messages import Message
from airlink.messages.command import CommandInt, CommandLong, ParamSet, ParamValue
from airlink.messages.system import Heartbeat
from flight_model.autopilot_model import within
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from flight_model.slot import Vector3
from formation_scenario.orders import End
from formation_scenario.path_plan import PathPlan
from formation_scenario.station import StationId
from formation_scenario.vehicles import VehicleModel
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.craft import Craft
from gcs_formation.vehicle.effect import Effect, armed_shown, mode_shown
from gcs_formation.vehicle.family_traits import FamilyTraits
from gcs_formation.vehicle.own_failsafe import OwnFailsafe, Parameters
from gcs_formation.vehicle.own_fence import OwnFence
from gcs_formation.vehicle.startup_step import ASKED_S, READY_S, Command, StartUpStep
from gcs_formation.vehicle.stored_mission import LandingSequence
from gcs_formation.vehicle.telemetry import Telemetry

STATION: Final = StationId().ids
"""The ground station's ids by default."""
SLOW_RATE_HZ: Final = 2.0
UTC_RATE_HZ: Final = 1.0
NEVER_US: Final = -1
FAILSAFE_IS_OVER: Final = ("off", "cleared", "regained")
"""Words in texts which report that a failsafe has ended."""
KnownSetpoints = list[CommandInt | None]
"""The airspeed, heading and height commands that a vehicle holds; None where one is to be sent."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Autopilot(FamilyTraits, ABC):
    """Encodes commands to one vehicle, and decodes its state, as its autopilot family requires."""

    keys: Any = None
    """The own keys of a family that an extension registers, a `Keys`."""
    failure: NotFiniteError | None = None
    """Why a family that an extension registers has failed; it is commanded as its base since."""

    def __init__(
        self,
        system: int,
        origin: GeodeticOrigin,
        turn_rate_max_rps: float,
        airspeed_scale: AirspeedScale | None = None,
    ) -> None:
        """Address `system`; positions and heights refer to the scenario's `origin`.

        With an `airspeed_scale`, airspeeds are converted between true values and the readings of the vehicle's sensor,
        in which it reports and is commanded; without one they are true.
        """
        self._guided_mode: int = self.guided_mode
        self.system = system
        self.origin = origin
        self.turn_rate_max_rps = turn_rate_max_rps
        self.airspeed_scale = airspeed_scale
        self.station: ComponentId = STATION
        """The ground station's ids: vehicles answer to them, and its heartbeats hold off their failsafe."""
        self._bounds_mps: tuple[float, float] | None = None
        """Lowest and highest airspeed to command by its own parameters, None where these allow the model's."""
        self.landing: LandingSequence | None = None
        """The landing of its stored mission, None without one, or as long as it wasn't read."""
        self.own_approach_m: float = self.approach_m
        """Height of the approach by `approach_parameter`, m; the default until that is read."""
        self.heights_m: tuple[float, float] | None = None
        """Lowest and highest height above the origin to command by its own geofence, m; None without one."""

    @classmethod
    def of(cls, craft: Craft) -> Autopilot:
        """Return the interface to a vehicle's autopilot."""
        return cls(craft.system, craft.origin, craft.model.turn_rate_max_rps, craft.airspeed_scale)

    def stand_in(self) -> tuple[Message, ...]:
        """Return what to send while there are no setpoints, for a family that accepts its mode only with a stream."""
        return ()

    def forget_setpoints(self) -> None:
        """Forget earlier setpoints: the vehicle has been flown otherwise meanwhile."""
        return  # most families keep none

    def tells_failsafe(self, text: str) -> bool:
        """Return whether a STATUSTEXT reports that a failsafe acts, rather than that it has ended."""
        lower = text.lower()
        over = any(word.strip(".:,;!") in FAILSAFE_IS_OVER for word in lower.split())
        return not over and any(word in lower for word in self.failsafe_words)

    def mode_name(self, telemetry: Telemetry) -> str:
        """Return the vehicle's mode in words."""
        mode = telemetry.custom_mode
        return "unknown" if mode is None else self.mode_names.get(mode, f"mode {mode}")

    def takes_setpoints(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle is armed, flying and in the mode in which it follows setpoints."""
        mode = telemetry.custom_mode
        return telemetry.armed and mode is not None and mode == self._guided_mode and self.is_airborne(telemetry)

    def effect(self, command: Command) -> Effect | None:
        """Return what heartbeats show after a command has been carried out, None if they don't show it."""
        mode = self.mode_asked(command)
        if mode is not None:
            return Effect(f"mode {self.mode_names.get(mode, mode)}", mode_shown, mode)
        if command.command == m.MAV_CMD_COMPONENT_ARM_DISARM:
            arm = bool(command.param1)
            return Effect("arming" if arm else "disarming", armed_shown, arm)
        return None

    def mode_asked(self, command: Command) -> int | None:
        """Return the mode, numbered as in heartbeats, that a command sets; None if it sets none."""
        return int(command.param2) if command.command == m.MAV_CMD_DO_SET_MODE else None

    def set_mode(self, mode: int) -> Command:
        """Return MAV_CMD_DO_SET_MODE for one of the family's own modes."""
        return self._command(m.MAV_CMD_DO_SET_MODE, m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)

    def set_message_interval(self, message_id: int, rate_hz: float) -> Command:
        """Return MAV_CMD_SET_MESSAGE_INTERVAL; a rate of 0 stops the message."""
        interval_us = round(1e6 / rate_hz) if rate_hz > 0.0 else NEVER_US
        return self._command(m.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us)

    def home_request(self) -> Command:
        """Return the request for its home position."""
        return self._command(m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_HOME_POSITION)

    def requests(self, rates_hz: Mapping[int, float]) -> tuple[Command, ...]:
        """Return the requests for all messages that aren't sent without one."""
        return tuple(self.set_message_interval(i, rates_hz[i]) for i in rates_hz if i not in self.unasked_hz)

    @abstractmethod
    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is from this family; mode numbers mean other modes in other families."""

    def rates_hz(self, telemetry_rate_hz: float, *, utc: bool = False) -> Mapping[int, float]:
        """Return the rate, Hz, of each message that the station needs, including those sent without a request.

        Motion messages have `telemetry_rate_hz`; `utc`: SYSTEM_TIME is needed too.
        """
        fast, slow = self.fast_messages, self.slow_messages
        rates_hz = dict.fromkeys(fast, telemetry_rate_hz) | dict.fromkeys(slow, SLOW_RATE_HZ) | self.unasked_hz
        return rates_hz | {m.MAVLINK_MSG_ID_SYSTEM_TIME: UTC_RATE_HZ} if utc else rates_hz

    @property
    def start_up_modes(self) -> frozenset[int]:
        """Modes that it passes through in its start-up."""
        return frozenset({self.take_off_mode, self.taken_off_mode, self.guided_mode})

    @abstractmethod
    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps from first contact to following setpoints in the air; the first asks for messages."""

    def _asked_and_ready(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, StartUpStep]:
        """Return the first two steps: telemetry streams, ready to arm."""
        asks = StartUpStep(
            "asked for telemetry",
            lambda seen: seen.complete,
            lambda _: self.requests(rates_hz),
            ASKED_S,
            True,
            slow=True,
        )
        return asks, self._ready_step()

    def _ready_step(self) -> StartUpStep:
        """Return the step that waits until it would arm, but for its present mode, or flies."""

        def lacks(seen: Telemetry) -> str:
            by_mode = seen.custom_mode in self.unarmable_modes
            return self._lacks_estimates(seen) if by_mode else self._lacks_to_arm(seen)

        def done(seen: Telemetry) -> bool:
            return self.is_airborne(seen) or not lacks(seen)

        return StartUpStep("waited for it to be ready to arm", done, timeout_s=READY_S, slow=True, lacks=lacks)

    def _armable_step(self) -> StartUpStep:
        """Return the step that waits until it would arm in the mode in which it takes off, or flies."""

        def done(seen: Telemetry) -> bool:
            return self.is_airborne(seen) or seen.armed or not self._lacks_to_arm(seen)

        return StartUpStep(
            "waited for it to be ready to arm", done, timeout_s=READY_S, slow=True, lacks=self._lacks_to_arm
        )

    def _lacks_estimates(self, seen: Telemetry) -> str:
        """Return in words what its estimator lacks, as far as it reports that; "" if nothing."""
        return "no heartbeat" if seen.heartbeat is None else ""

    def _lacks_to_arm(self, seen: Telemetry) -> str:
        """Return in words what it lacks to be armed, "" if nothing."""
        passes = seen.sensors_healthy & m.MAV_SYS_STATUS_PREARM_CHECK
        unpassed = "" if passes or seen.heartbeat is None else "SYS_STATUS: PREARM_CHECK not passed"
        return "; ".join(filter(None, (self._lacks_estimates(seen), unpassed)))

    def _armed_step(self) -> StartUpStep:
        return StartUpStep(
            "armed",
            lambda seen: seen.armed,
            lambda _: (self._arm_or_disarm(arm=True),),
            30.0,
            takes_off=True,
            arms=True,
        )

    def is_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle flies: it is armed, and well above home or reports flight."""
        return telemetry.armed and (telemetry.aloft or self.says_airborne(telemetry))

    @abstractmethod
    def says_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle reports that it flies, takes off or lands."""

    @abstractmethod
    def says_grounded(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle reports that it is on the ground, regardless of its height."""

    def is_grounded(self, telemetry: Telemetry) -> bool:
        """Return whether it is certainly on the ground: disarmed, or reported so at a height that agrees."""
        if telemetry.heartbeat is None or telemetry.boots:
            return False
        at_home = telemetry.motion is not None and self.says_grounded(telemetry)
        return not telemetry.armed or (at_home and not self.is_airborne(telemetry))

    def climbs_out(self, telemetry: Telemetry) -> bool:
        """Return whether a fixed wing is still climbing in its take-off."""
        motion = telemetry.motion
        if motion is None or telemetry.hovers:
            return False
        return telemetry.custom_mode == self.take_off_mode and motion.above_home_m <= self.take_off_m

    def _is_taking_off(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) or seen.custom_mode == self.take_off_mode

    @property
    def speeds_mps(self) -> tuple[float, float] | None:
        """Lowest and highest true airspeed within reach soon, m/s; None if these are its model's limits."""
        return self._bounds_mps if self.airspeed_scale is None else self.airspeed_scale.speeds_mps

    def bound_speeds(self, slowest_mps: float, fastest_mps: float) -> None:
        """Command no airspeeds beyond these, as reported: the vehicle's parameters refuse or cut off others."""
        if self.airspeed_scale is None:
            self._bounds_mps = slowest_mps, fastest_mps
        else:
            self.airspeed_scale.bound(slowest_mps, fastest_mps)

    def true_airspeed(self, reported_mps: float) -> float:
        """Return the true airspeed of one that it reports, m/s."""
        return reported_mps if self.airspeed_scale is None else self.airspeed_scale.true(reported_mps)

    def commanded_airspeed(self, true_mps: float) -> float:
        """Return the airspeed to command for a true airspeed, m/s."""
        if self.airspeed_scale is not None:
            return self.airspeed_scale.indicated(true_mps)
        bounds_mps = self._bounds_mps
        return true_mps if bounds_mps is None else within(true_mps, bounds_mps[0], bounds_mps[1])

    @abstractmethod
    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return the messages of a setpoint that takes effect when the vehicle is in the state `where`."""

    def quantities(self, setpoint: Setpoint, where: FlightState) -> Vector3:  # noqa: ARG002 - for some
        """Return what the messages of a setpoint say: airspeed as commanded, m/s, direction, rad, and height, m.

        A setpoint is sent when these differ from what the vehicle holds. A subclass that commands others says so here.
        """
        return self.commanded_airspeed(setpoint.speed_mps), setpoint.heading_rad, setpoint.height_m

    @property
    def prompt_share(self) -> float:
        """The share of a change of the commanded airspeed that is flown at once; an integrator adds the rest."""
        return 1.0

    def keep_setpoint(self) -> None:
        """Take that the vehicle keeps its setpoint for another tick."""
        return  # most families have no memory of setpoints

    def changed(self, setpoint: Setpoint, where: FlightState, known: KnownSetpoints) -> list[Message]:  # noqa: ARG002 - for some
        """Return those messages of a setpoint whose commands aren't `known`; most families need all of them."""
        return list(self.setpoint(setpoint, where))

    @abstractmethod
    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the parameter checks to make before a vehicle with this `model` flies the path."""

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:  # noqa: ARG002 - for families that have one
        """Return its failsafe by the values of `failsafe_parameters` that are known; None if it has none."""
        return None

    def take_approach(self, values: Parameters) -> None:
        """Take the height of its own approach from its parameters; the default where that isn't among them."""
        self.own_approach_m = values.get(self.approach_parameter, self.approach_m)

    def own_fence(self, values: Parameters) -> OwnFence | None:  # noqa: ARG002 - for families that have one
        """Return its geofence by the values of its parameters; None if it has none, or it is off."""
        return None

    def parameter(self, reported: ParamValue) -> float:
        """Return a parameter's value from its PARAM_VALUE."""
        return reported.param_value

    def set_parameter(self, name: str, value: float, kind: int) -> ParamSet:
        """Return PARAM_SET of a parameter of a MAV_PARAM_TYPE."""
        return ParamSet(self.system, m.MAV_COMP_ID_AUTOPILOT1, name, value, kind)

    def stand_down(self) -> tuple[Command, ...]:
        """Return the commands that keep a vehicle on the ground; one in flight refuses them."""
        return (self._arm_or_disarm(arm=False),)

    def _arm_or_disarm(self, *, arm: bool) -> Command:
        return self._command(m.MAV_CMD_COMPONENT_ARM_DISARM, float(arm))

    def _command(self, command: int, *params: float) -> CommandLong:
        """Return a COMMAND_LONG to the vehicle's autopilot with these first parameters."""
        return CommandLong(self.system, m.MAV_COMP_ID_AUTOPILOT1, command, 0, *params)

    def leave(self, manner: End, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return the commands that end a flight: circle here or, for `rtl` and before `land`, over home."""
        if manner == "land":
            return self.wait_over_home(height_m, seen)
        return self.loiter(height_m, seen) if manner == "loiter" else self.go_home(height_m, seen)

    def wait_over_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return the commands to wait over home for its turn to land, at `height_m` above the scenario's origin."""
        return self.go_home(height_m, seen)

    def land(self) -> tuple[Command, ...]:
        """Return the commands to land by its mission, or where it took off; empty if it can't."""
        return self.land_by_mission() if self.landing is not None else ()

    def land_by_mission(self) -> tuple[Command, ...]:
        """Return MAV_CMD_DO_LAND_START, which flies the landing of its mission."""
        return (self._command(m.MAV_CMD_DO_LAND_START),)

    @property
    def highest_approach_m(self) -> float:
        """Greatest height above home of its approach, m."""
        return self.own_approach_m if self.landing is None else self.landing.approach_m

    def hold(self) -> tuple[Command, ...]:
        """Return the command to circle or hover where it is, at its present height."""
        return (self.set_mode(self.loiter_mode),)

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - for fixed wings
        """Return the commands, in order, to fly home and circle there at `height_m` above the scenario's origin.

        A multirotor returns at its present height, or at its return altitude if that is higher, and lands.
        """
        return (self.set_mode(self.home_mode),)

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - for fixed wings
        """Return the commands, in order, to circle where it was `seen`, at `height_m` above the scenario's origin."""
        return self.hold()
