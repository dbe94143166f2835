"""Keys of the vehicles."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from airlink.identity import VehicleId
from formation_scenario.fields import (
    MAX_SYSTEM_ID,
    Allowed,
    Keys,
    NetworkId,
    Number,
    Positive,
    Speed,
    SystemId,
    Text,
    TimeConstant,
)
from formation_scenario.navigation import Navigation, TrueNavigation

BASE_PORT = 14550
MAX_CLOCK_S = 4e6
"""MAVLink's time since boot, 32 bits of milliseconds, ends at 4.29e6 s."""

Autopilot = Literal["emulator", "arduplane", "arducopter", "px4"]


class VehicleModel(Keys):
    """Autopilot lags (equation 7) and the limits of flight; defaults: a fixed wing that cruises at 22 m/s."""

    tau_v_s: TimeConstant = Field(default=4.0, description="time constant of airspeed, s")
    tau_psi_s: TimeConstant = Field(default=1.5, description="time constant of heading, s")
    tau_ha_s: TimeConstant = Field(default=1.0, description="first time constant of height, s")
    tau_hb_s: TimeConstant = Field(default=3.0, description="second time constant of height, s")
    speed_min_mps: Speed = Field(default=16.0, description="lowest airspeed, m/s")
    speed_max_mps: Speed = Field(default=28.0, description="highest airspeed, m/s")
    accel_max_mps2: Positive = Field(default=1.5, description="largest change of airspeed, m/s²")
    turn_rate_max_rps: Positive = Field(default=0.25, description="highest turn rate, rad/s")
    climb_max_mps: Speed = Field(default=3.0, description="highest climb and descent rate, m/s")


class VehicleClock(Keys):
    """Offset and drift of a vehicle's clock relative to the ground station's; its time stamps carry them."""

    offset_s: Annotated[Number, Field(ge=0.0, le=MAX_CLOCK_S)] = Field(
        default=0.0, description="vehicle's clock minus true time at t = 0, s"
    )
    drift_ppm: Annotated[Number, Field(ge=-1e5, le=1e5)] = Field(
        default=0.0, description="how much faster than true time the vehicle's clock runs, 1e-6"
    )


class VehicleCommon(Keys):
    """Keys of a vehicle in the list, and of a group `{count: N}`."""

    network: NetworkId = Field(default=1, description="MAVLink network; each has system ids 1 to 254 of its own")
    endpoint: Text = Field(
        default=f"udpin:127.0.0.1:{BASE_PORT}",
        description="where the ground station listens; default: one port a network, 14549 + network",
    )
    autopilot: Autopilot = Field(default="emulator", description="emulator | arduplane | arducopter | px4")
    model: VehicleModel = VehicleModel()
    navigation: Navigation = TrueNavigation()
    clock: VehicleClock = VehicleClock()


class VehicleIdentity(Keys):
    """Keys of a vehicle in the list only."""

    id: SystemId = Field(description="MAVLink system id, unique on its network")
    role: Literal["leader", "follower"] = Field(default="follower", description="leader | follower")


class Vehicle(VehicleCommon, VehicleIdentity):
    """One vehicle of the list."""

    @property
    def vehicle_id(self) -> VehicleId:
        """Network and system id."""
        return VehicleId(self.network, self.id)


Count = Annotated[
    int,
    Field(strict=True, ge=1, le=MAX_SYSTEM_ID),
    Allowed(f"1 to {MAX_SYSTEM_ID} on one network; for more give a list, part of it with another `network`"),
]


class VehicleGroup(VehicleCommon):
    """`vehicles: {count: N, ...}`: N identical vehicles, of which vehicle 1 leads."""

    count: Count = Field(description="number of vehicles, the leader included")
