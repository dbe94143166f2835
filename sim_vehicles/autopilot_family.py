"""The hooks in which families of emulated autopilots differ: what each must give, and what it may override.

A family may also extend what `vehicle.Vehicle` does alike for all: `arm`, `disarm`, `tell_heartbeat` and `say`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

from sim_vehicles.autopilot.modes_and_failsafe import FlightMode, GroundStationFailsafe
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.telemetry import BUILDERS, Builders

if TYPE_CHECKING:
    from sim_vehicles.airframe.motion import Steering
    from sim_vehicles.autopilot.message_handler import MessageHandler
    from sim_vehicles.autopilot.pilot import Pilot
    from sim_vehicles.autopilot.position_targets import Setpoint
    from sim_vehicles.config import VehicleConfig


class AutopilotFamily(ABC):
    """The hooks of `Vehicle`'s main loop: first what every family must have, then what it may."""

    mav_type: ClassVar[int]
    capabilities: ClassVar[int]
    """Those of the real one (MAV_PROTOCOL_CAPABILITY), though not all are emulated."""
    version: ClassVar[int] = 4 << 24 | 7 << 16
    unasked: ClassVar[Mapping[int, int]]
    """Messages that it sends without a request, and every how many ns."""
    builders: ClassVar[Builders] = BUILDERS
    """All that it can send."""
    asks_time: ClassVar[bool] = True
    """Whether it asks others for their time (TIMESYNC)."""
    tells_time_at_once: ClassVar[bool] = False
    """Whether it answers TIMESYNC as it comes, not in its main loop."""
    stores_missions: ClassVar[bool] = True
    """Whether missions can be written to it."""
    locks: ClassVar[bool] = False
    """Whether its link hears the first sender alone, until it restarts."""
    boot_mode: ClassVar[FlightMode]
    """Its pilot's mode at boot."""
    ground_mode: ClassVar[FlightMode]
    """Its pilot's mode on the ground, once it is up."""
    air_mode: ClassVar[FlightMode]
    """Its pilot's mode where it starts in the air."""
    guided_mode: ClassVar[FlightMode]
    """The mode in which it follows a ground station."""
    by_hand: ClassVar[frozenset[int]]
    """Modes whose HEARTBEAT lacks the flag GUIDED_ENABLED."""
    armed_text: ClassVar[str] = "Throttle armed"
    disarmed_text: ClassVar[str] = "Throttle disarmed"

    @abstractmethod
    def parameters_of(self, config: VehicleConfig) -> ParameterServer:
        """Return its parameters."""

    @abstractmethod
    def pilot_of(self, config: VehicleConfig, steering: Steering) -> Pilot:
        """Return who flies it, by sticks, setpoints or a mission."""

    @abstractmethod
    def message_handler(self) -> MessageHandler:
        """Return what takes its messages, and knows its commands."""

    @abstractmethod
    def failsafe_of(self) -> GroundStationFailsafe:
        """Return its failsafe for the end of the ground station's heartbeats."""

    @abstractmethod
    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""

    @abstractmethod
    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed."""

    @abstractmethod
    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once."""

    @abstractmethod
    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Fly to a place, whose height is above the fleet's origin, and stay there or circle it."""

    @abstractmethod
    def take_setpoint(self, setpoint: Setpoint) -> None:
        """Fly by a setpoint of place or velocity, as far as the mode allows."""

    @abstractmethod
    def follow_time(self) -> None:
        """Do what is due by now in its mode; called in every cycle."""

    @abstractmethod
    def landed(self) -> None:
        """Prepare to disarm: it has touched down."""

    def forget(self) -> None:
        """Forget, at boot, the state that only the family has."""
        return

    @property
    def flies_mission(self) -> bool:
        """Whether it flies by its stored mission."""
        return False

    def ask_circle(self, radius_m: float, side: float) -> None:  # noqa: ARG002 - what stands flies none
        """Take the radius, m, and the side of the circles that it is told next."""
        return

    def climb_to(self, height_m: float) -> None:  # noqa: ARG002 - what stands keeps its own
        """Take a height above the origin that was told without a place."""
        return
