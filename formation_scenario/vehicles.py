"""Keys of the vehicles, and of aircraft that don't fly by equation (7)."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from airlink.endpoint import VehicleId
from flight_model.autopilot import AutopilotModel
from formation_scenario.fields import (
    MAX_SYSTEM_ID,
    Allowed,
    Flag,
    Fraction,
    Keys,
    NetworkId,
    NonNegative,
    Number,
    Positive,
    Speed,
    SystemId,
    Text,
    TimeConstant,
    derived,
)
from formation_scenario.navigation import Navigation, TrueNavigation

Lag = Annotated[Positive, Field(ge=0.04, le=100.0)]
Angle = Annotated[Number, Field(ge=-85.0, le=85.0)]
LeastSpeed = Annotated[Number, Field(ge=0.0, le=1e3)]
BASE_PORT = 14550
MAX_CLOCK_S = 4e6
"""MAVLink's time since boot, 32 bits of milliseconds, ends at 4.29e6 s."""
Autopilot = Literal["emulator", "arduplane", "arducopter", "px4"]
Family = Literal["arduplane", "arducopter", "px4_plane", "px4_copter"]
Count = Annotated[
    int,
    Field(strict=True, ge=1, le=MAX_SYSTEM_ID),
    Allowed(f"1 to {MAX_SYSTEM_ID} on one network; for more give a list, part of it with another `network`"),
]


class EnergyAirframe(Keys):
    """An aircraft under total-energy control; the defaults are ArduPlane's, and its simulator's plane.

    Names in capitals are ArduPilot's parameters.
    """

    kind: Literal["energy"] = Field(default="energy", description="total-energy control of speed and height")
    thrust_mps2: Positive = Field(default=14.0, description="acceleration by full throttle, m/s²", examples=[10])
    drag_mps2: Positive = Field(default=6.7, description="deceleration by parasitic drag at 22 m/s, m/s²", examples=[4])
    induced_drag_mps2: NonNegative = Field(
        default=0.065, description="the same by lift's own drag in level flight, m/s²", examples=[0.5]
    )
    lift_mps2_per_rad: Positive = Field(
        default=460.0, description="acceleration by lift at 22 m/s for a radian of incidence, m/s²", examples=[300]
    )
    throttle_slew_per_s: Positive = Field(
        default=1.0, description="fastest change of throttle (THR_SLEWRATE), 1/s", examples=[0.5]
    )
    bank_lag_s: Lag = Field(default=0.5, description="time constant of bank (RLL2SRV_TCONST), s", examples=[0.4])
    pitch_lag_s: Lag = Field(default=0.5, description="time constant of pitch (PTCH2SRV_TCONST), s", examples=[0.4])
    rate_lag_s: Lag = Field(default=0.1, description="time constant of roll and pitch rates, s", examples=[0.2])
    bank_max_deg: Annotated[Positive, Field(le=85.0)] = Field(
        default=65.0, description="largest bank (ROLL_LIMIT_DEG), degrees", examples=[45]
    )
    heading_gain: Positive = Field(
        default=math.radians(50.0), description="bank for an error of heading (GUIDED_P), rad/rad", examples=[1.2]
    )
    pitch_max_deg: Angle = Field(default=15.0, description="largest pitch (TECS_PITCH_MAX), degrees", examples=[20])
    pitch_min_deg: Angle = Field(default=-25.0, description="least pitch (PTCH_LIM_MIN_DEG), degrees", examples=[-20])
    throttle_cruise: Fraction = Field(
        default=0.5, description="throttle in level flight as the autopilot believes (TRIM_THROTTLE)", examples=[0.45]
    )
    airspeed_min_mps: Speed = Field(
        default=10.0, description="the autopilot's least airspeed (AIRSPEED_MIN), m/s", examples=[12]
    )
    airspeed_cruise_mps: Speed = Field(
        default=22.0, description="its cruising airspeed (AIRSPEED_CRUISE), m/s", examples=[20]
    )
    airspeed_max_mps: Speed = Field(
        default=30.0, description="its greatest airspeed (AIRSPEED_MAX), m/s", examples=[28]
    )
    climb_max_mps: Speed = Field(
        default=5.0, description="climb at full throttle as the autopilot believes (TECS_CLMB_MAX), m/s", examples=[4]
    )
    sink_min_mps: Speed = Field(
        default=2.0, description="sink without throttle as the autopilot believes (TECS_SINK_MIN), m/s", examples=[1.5]
    )
    sink_max_mps: Speed = Field(default=5.0, description="fastest sink (TECS_SINK_MAX), m/s", examples=[4])
    time_constant_s: Lag = Field(default=5.0, description="of the energy control (TECS_TIME_CONST), s", examples=[3])
    height_lag_s: Lag = Field(default=3.0, description="lag of the demanded height (TECS_HDEM_TCONST), s", examples=[2])
    throttle_damping: NonNegative = Field(
        default=0.5, description="how errors of the energy's rate drive the throttle (TECS_THR_DAMP), s", examples=[0.7]
    )
    pitch_damping: NonNegative = Field(
        default=0.3, description="how errors of the balance's rate drive the pitch (TECS_PTCH_DAMP)", examples=[0.5]
    )
    integral_gain: NonNegative = Field(
        default=0.3, description="integral of both (TECS_INTEG_GAIN), 1/s", examples=[0.1]
    )
    speed_weight: Annotated[NonNegative, Field(le=2.0)] = Field(
        default=1.0, description="what pitch is for: 0 height, 2 speed, 1 both (TECS_SPDWEIGHT)", examples=[0.8]
    )
    bank_to_throttle: NonNegative = Field(
        default=10.0, description="throttle for what a bank costs (TECS_RLL2THR), m²/s³", examples=[15]
    )
    vertical_accel_max_mps2: Positive = Field(
        default=7.0, description="largest vertical acceleration (TECS_VERT_ACC), m/s²", examples=[5]
    )
    speed_filter_radps: Positive = Field(
        default=2.0, description="bandwidth of its airspeed estimate (TECS_SPD_OMEGA), rad/s", examples=[1.5]
    )
    airspeed_lag_s: Lag = Field(default=0.28, description="lag of the airspeed's measurement, s", examples=[0.1])
    airspeed_rate_hz: Annotated[Positive, Field(ge=1.0, le=50.0)] = Field(
        default=10.0, description="new airspeeds a second in telemetry, Hz", examples=[20]
    )
    airspeed_step_mps: NonNegative = Field(
        default=0.01, description="resolution of airspeed in telemetry, m/s", examples=[0.1]
    )
    airspeed_noise_mps: NonNegative = Field(
        default=0.06, description="standard deviation of the sensor's white noise, before its lag, m/s", examples=[0.2]
    )
    dead_time_s: Annotated[NonNegative, Field(le=2.0)] = Field(
        default=0.1, description="from a setpoint's arrival until the autopilot heeds it, s", examples=[0.2]
    )
    spread: Annotated[NonNegative, Field(le=0.3)] = Field(
        default=0.02,
        description="standard deviation of what differs from aircraft to aircraft (thrust, drag, lift, lags), "
        "as a share; drawn by the scenario's seed",
        examples=[0.05],
    )

    def parameters(self) -> dict[str, float]:
        """Return the constants of motion and autopilot by the names of `flight_model.energy`, SI."""
        keys: dict[str, float] = self.model_dump()
        return {_si(name): math.radians(value) if name.endswith("_deg") else value for name, value in keys.items()}


def _si(name: str) -> str:
    return name.removesuffix("_deg") + "_rad" if name.endswith("_deg") else name


class VehicleModel(Keys):
    """Autopilot lags (equation 7) and the limits of flight; defaults: a fixed wing that cruises at 22 m/s."""

    tau_v_s: TimeConstant = Field(default=4.0, description="time constant of airspeed, s", examples=[5])
    tau_psi_s: TimeConstant = Field(default=1.5, description="time constant of heading, s", examples=[3.4])
    tau_ha_s: TimeConstant = Field(default=1.0, description="first time constant of height, s", examples=[1.5])
    tau_hb_s: TimeConstant = Field(default=3.0, description="second time constant of height, s", examples=[2])
    speed_min_mps: LeastSpeed = Field(
        default=16.0, description="lowest airspeed, m/s; 0 only of what hovers", examples=[14]
    )
    speed_max_mps: Speed = Field(default=28.0, description="highest airspeed, m/s", examples=[29])
    accel_max_mps2: Positive = Field(default=1.5, description="largest change of airspeed, m/s²", examples=[1])
    turn_rate_max_rps: Positive = Field(default=0.25, description="highest turn rate, rad/s", examples=[0.2])
    climb_max_mps: Speed = Field(default=3.0, description="highest climb and descent rate, m/s", examples=[4])
    hovers: Flag = Field(
        default=False,
        description="whether it is a multirotor: it flies the velocity over ground that it is told, down to 0, in any "
        "direction; tau_v_s is its lag in each, and airspeeds above are ground speeds",
        examples=[True],
    )
    prompt_share: Annotated[Positive, Field(ge=0.2, le=1.0)] = Field(
        default=1.0,
        description="of what hovers, and of a PX4: share of a change of the speed told that it flies with tau_v_s; the "
        "rest comes as its integrator makes up for drag",
        examples=[0.7],
    )
    rest_s: Lag = Field(default=5.0, description="time constant of that rest, s", examples=[9])
    firmware: Literal["ardupilot", "px4"] = Field(
        default="ardupilot", description="emulators: as whose autopilot it speaks", examples=["px4"]
    )
    airframe: EnergyAirframe | None = Field(
        default=None,
        description="emulators: the aircraft that flies where that isn't equation (7), which the keys above then only "
        "approximate; without it, equation (7) itself",
    )

    def autopilot(self) -> AutopilotModel:
        """Return equation (7) with these lags and limits, as an object of its own: its lags may be learnt in flight."""
        return AutopilotModel(
            self.tau_v_s,
            self.tau_psi_s,
            self.tau_ha_s,
            self.tau_hb_s,
            self.speed_min_mps,
            self.speed_max_mps,
            self.accel_max_mps2,
            self.turn_rate_max_rps,
            self.climb_max_mps,
        )

    def soon_mps(self, speed_mps: float) -> tuple[float, float]:
        """Return the lowest and the highest airspeed that one that flies at `speed_mps` comes to within its lag.

        Of what a fixed wing's integrator makes up for, nothing counts: that takes longer than bends and ways to slots.
        """
        if self.hovers or self.prompt_share == 1.0:
            return self.speed_min_mps, self.speed_max_mps
        slower_mps, faster_mps = speed_mps - self.speed_min_mps, self.speed_max_mps - speed_mps
        return speed_mps - self.prompt_share * slower_mps, speed_mps + self.prompt_share * faster_mps


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
        json_schema_extra=derived("the keys' own; with any `autopilot` but `emulator`, the shipped file of that name"),
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


def family_of(vehicle: VehicleCommon) -> Family:
    """Return the autopilot family that a vehicle speaks as; an emulator's is that of its model."""
    return spoken(vehicle.autopilot, vehicle.model)


def spoken(named: Autopilot, model: VehicleModel) -> Family:
    """Return the family of an autopilot as the scenario names it, on a vehicle with this model."""
    if named == "px4" or (named == "emulator" and model.firmware == "px4"):
        return "px4_copter" if model.hovers else "px4_plane"
    if named == "emulator":
        return "arducopter" if model.hovers else "arduplane"
    return named


class VehicleGroup(VehicleCommon):
    """`vehicles: {count: N, ...}`: N identical vehicles, of which vehicle 1 leads."""

    count: Count = Field(description="number of vehicles, the leader included", examples=[20])
