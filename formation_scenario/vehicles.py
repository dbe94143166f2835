"""Keys of the vehicles."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from airlink.identity import VehicleId
from formation_scenario.airframe import EnergyAirframe
from formation_scenario.fields import (
    MAX_SYSTEM_ID,
    Allowed,
    Flag,
    Keys,
    NetworkId,
    Number,
    Positive,
    Speed,
    SystemId,
    Text,
    TimeConstant,
    derived,
)
from formation_scenario.navigation import Navigation, TrueNavigation

BASE_PORT = 14550
MAX_CLOCK_S = 4e6
"""MAVLink's time since boot, 32 bits of milliseconds, ends at 4.29e6 s."""

Autopilot = Literal["emulator", "arduplane", "arducopter", "px4"]


class VehicleModel(Keys):
    """Autopilot lags (equation 7) and the limits of flight; defaults: a fixed wing that cruises at 22 m/s."""

    tau_v_s: TimeConstant = Field(default=4.0, description="time constant of airspeed, s", examples=[5])
    tau_psi_s: TimeConstant = Field(default=1.5, description="time constant of heading, s", examples=[3.4])
    tau_ha_s: TimeConstant = Field(default=1.0, description="first time constant of height, s", examples=[1.5])
    tau_hb_s: TimeConstant = Field(default=3.0, description="second time constant of height, s", examples=[2])
    speed_min_mps: Speed = Field(default=16.0, description="lowest airspeed, m/s", examples=[14])
    speed_max_mps: Speed = Field(default=28.0, description="highest airspeed, m/s", examples=[29])
    accel_max_mps2: Positive = Field(default=1.5, description="largest change of airspeed, m/s²", examples=[1])
    turn_rate_max_rps: Positive = Field(default=0.25, description="highest turn rate, rad/s", examples=[0.2])
    climb_max_mps: Speed = Field(default=3.0, description="highest climb and descent rate, m/s", examples=[4])
    airframe: EnergyAirframe | None = Field(
        default=None,
        description="emulators: the aircraft that flies where that isn't equation (7), which the keys above then only "
        "approximate; without it, equation (7) itself",
    )


Model: TypeAlias = Annotated[
    VehicleModel,
    Allowed(
        f"a vehicle file (*.yaml), the name of a shipped one, or a mapping with {', '.join(VehicleModel.model_fields)}"
    ),
]


class VehicleClock(Keys):
    """Offset and drift of a vehicle's clock relative to the ground station's; its time stamps carry them."""

    offset_s: Annotated[Number, Field(ge=0.0, le=MAX_CLOCK_S)] = Field(
        default=0.0, description="vehicle's clock minus true time at t = 0, s", examples=[0.25]
    )
    drift_ppm: Annotated[Number, Field(ge=-1e5, le=1e5)] = Field(
        default=0.0, description="how much faster than true time the vehicle's clock runs, 1e-6", examples=[20]
    )
    utc: Flag = Field(default=True, description="whether it knows UTC, by its GNSS receiver")
    utc_error_s: Annotated[Number, Field(ge=-1e6, le=1e6)] = Field(
        default=0.0, description="error of its receiver's UTC, s", examples=[0.05]
    )


class VehicleCommon(Keys):
    """Keys of a vehicle in the list, and of a group `{count: N}`."""

    network: NetworkId = Field(
        default=1, description="MAVLink network; each has system ids 1 to 254 of its own", examples=[2]
    )
    endpoint: Text = Field(
        default=f"udpin:127.0.0.1:{BASE_PORT}",
        description="where the ground station listens: udpin:HOST:PORT",
        json_schema_extra=derived("udpin:127.0.0.1, one port a network: 14549 + network"),
        examples=["udpin:0.0.0.0:14552"],
    )
    autopilot: Autopilot = Field(
        default="emulator", description="what flies the vehicle: an emulator, or one of the real autopilots"
    )
    model: Model = Field(
        default=VehicleModel(),
        description="its autopilot's lags, and its limits: keys, a vehicle file, or a shipped one by its name",
        json_schema_extra=derived("the keys' own; with `autopilot: arduplane` or `px4`, the shipped file of that name"),
    )
    true_model: Model | None = Field(
        default=None,
        description="emulators only: what the vehicle flies by where that differs from `model`, which the station "
        "believes",
        json_schema_extra=derived("the keys of `model`"),
    )
    navigation: Navigation = Field(default=TrueNavigation(), description="how well its telemetry knows its state")
    true_navigation: Navigation | None = Field(
        default=None,
        description="emulators only: how well it does where that differs from `navigation`, which the station believes",
        json_schema_extra=derived("as `navigation`"),
    )
    clock: VehicleClock = VehicleClock()


class VehicleIdentity(Keys):
    """Keys of a vehicle in the list only."""

    id: SystemId = Field(description="MAVLink system id, unique on its network", examples=[2])
    role: Literal["leader", "follower"] = Field(
        default="follower", description="whether it leads at the start; one vehicle may"
    )


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

    count: Count = Field(description="number of vehicles, the leader included", examples=[20])
