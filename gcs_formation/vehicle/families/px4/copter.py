# Compiled by mypyc: it runs every tick.

"""PX4 multirotors: how they are commanded, and the parameters on which a flight depends.

A multirotor is commanded in OFFBOARD by a stream of SET_POSITION_TARGET_LOCAL_NED with velocity and yaw, which must
start before the mode is set and never pause for longer than COM_OF_LOSS_T.

Sources: PX4 user guide, "Flight Modes" ("Hold" and "Takeoff" of fixed wings, "Offboard", "Return"), "Parameter
Reference" and "Safety Configuration (Failsafes)"; what it accepts and refuses was observed in its simulator (SIH).
"""

from __future__ import annotations

import math

from mypy_extensions import mypyc_attr

from airlink.messages import Message
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check, climb_check, lowest_m, only_read
from gcs_formation.vehicle.craft import Craft
from gcs_formation.vehicle.families.px4.px4 import LAND, LOITER, OFFBOARD, RTL, STREAM_LOSS_S, Px4, heartbeats_lost
from gcs_formation.vehicle.own_failsafe import OwnFailsafe, Parameters
from gcs_formation.vehicle.own_fence import GEOFENCE_NAMES
from gcs_formation.vehicle.reposition import fly_to_home
from gcs_formation.vehicle.startup_step import Command
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import (
    MULTIROTOR_TYPES,
    TURNS_FROM_MPS,
    VelocityLead,
    hovers,
    velocity_lead,
    velocity_setpoint,
)

PATIENCE_S = 0.5
"""Least COM_OF_LOSS_T: a shorter timeout would trigger on a few lost setpoints."""
CUTS_MOTORS = (6, 7)
"""COM_OBL_RC_ACT: terminate, disarm."""
WITHOUT_STICKS = (0, 3, 4, 5)
"""COM_OBL_RC_ACT: position (return, without a transmitter), return, land, hold."""
HOVER = Setpoint(0.0, 0.0, 0.0)
ANYWHERE = FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
STREAM_LEADS_TO = {4: frozenset({LOITER, LAND}), 5: frozenset({LOITER})}
"""COM_OBL_RC_ACT: the same; without a transmitter others are a hold and RTL."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Copter(Px4):
    """A PX4 multirotor or helicopter, commanded in OFFBOARD by velocity setpoints."""

    family = "PX4 multirotor"
    types = MULTIROTOR_TYPES
    take_off_m = 18.0
    take_off_to_m = 20.0
    guided_mode = OFFBOARD
    setpoint_commands = ()
    hovers_after_s = 1.0
    """COM_OF_LOSS_T; then it stops, and returns or lands (COM_OBL_RC_ACT)."""
    returns_after_s = 6.0
    """COM_OF_LOSS_T plus COM_FAIL_ACT_T, during which some versions hold first."""
    hovers = True
    failsafe_parameters = ("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_OBL_RC_ACT", "COM_OF_LOSS_T")
    acknowledges_early = True
    """DO_SET_MODE is acknowledged twice, the first time always with ACCEPTED."""

    def __init__(
        self, system: int, origin: GeodeticOrigin, turn_rate_max_rps: float, lead: VelocityLead | None = None
    ) -> None:
        """Address `system`; `lead` compensates the slow integrator of its model."""
        super().__init__(system, origin, turn_rate_max_rps)
        self._nose_rad, self._lead = math.nan, lead or VelocityLead()

    @classmethod
    def of(cls, craft: Craft) -> Autopilot:
        """Return the interface to a vehicle's autopilot."""
        return cls(craft.system, craft.origin, craft.model.turn_rate_max_rps, velocity_lead(craft.model, craft.tick_s))

    def forget_setpoints(self) -> None:
        """Restart the lead compensation."""
        self._lead.reinitialise()

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:
        """Return its failsafe for lost setpoints, which acts sooner than that for lost heartbeats, or both."""
        action, by_heartbeats = values.get("COM_OBL_RC_ACT"), super().own_failsafe(values)
        if action is None or action in CUTS_MOTORS:
            return by_heartbeats
        modes = STREAM_LEADS_TO.get(int(action), frozenset({LOITER, RTL}))
        more = frozenset[int]() if by_heartbeats is None else by_heartbeats.modes
        return OwnFailsafe(values.get("COM_OF_LOSS_T", STREAM_LOSS_S), modes | more)

    def stand_in(self) -> tuple[Message, ...]:
        """Return a setpoint of zero velocity."""
        return (velocity_setpoint(self.system, HOVER, ANYWHERE, self._lead, self._nose_rad),)

    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the checks of failsafes and limits."""
        fastest, speed = model.speed_max_mps, path.begin_mps
        return (
            heartbeats_lost("flies on as long as setpoints come"),
            Check(
                ("COM_OF_LOSS_T",),
                f"{PATIENCE_S:g} s or more; setpoints come with every tick, and some are lost",
                lambda value: value >= PATIENCE_S,
            ),
            Check(
                ("COM_OBL_RC_ACT",),
                "0 or 3 (return), 4 (land) or 5 (hold) when setpoints stop; 1 and 2 need a pilot, "
                "6 and 7 stop the motors",
                lambda value: value in WITHOUT_STICKS,
                lambda value: value in CUTS_MOTORS,
            ),
            Check(
                ("MPC_XY_VEL_MAX",),
                f"{fastest:g} m/s or more, its model's speed_max_mps; it flies no faster",
                lambda value: value >= fastest,
                lambda value: value < speed,
                bounds=lambda value: ("speed_max_mps", value),
                asks=fastest,
            ),
            Check(
                ("RTL_RETURN_ALT",),
                "at most the lowest height of the path: lower than that, none climbs into others on the way home",
                lambda value: value <= lowest_m(path),
            ),
            climb_check(("MPC_Z_VEL_MAX_UP",), model),
            climb_check(("MPC_Z_VEL_MAX_DN",), model),
            *map(only_read, GEOFENCE_NAMES),
        )

    def wait_over_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return DO_REPOSITION to its home, in Hold: unlike RTL it flies there at its own height, and stays."""
        return fly_to_home(self, height_m, seen) or self.go_home(height_m, seen)

    def land(self) -> tuple[Command, ...]:
        """Return AUTO.LAND, which comes down where it hovers, and disarms."""
        return (self.set_mode(LAND),)

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return one message: velocity over ground, and the course as yaw while it moves.

        In hover the last yaw is repeated: with a yaw rate of 0 alone the heading drifts by tens of degrees. Setpoints
        are sent at every tick: COM_OF_LOSS_T after the last one the failsafe leaves OFFBOARD, until they resume.
        """
        if setpoint.speed_mps >= TURNS_FROM_MPS or hovers(setpoint):
            self._nose_rad = setpoint.heading_rad
        return (velocity_setpoint(self.system, setpoint, where, self._lead, self._nose_rad),)
