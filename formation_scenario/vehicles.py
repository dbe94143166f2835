"""Keys of the vehicles, and of aircraft that don't fly by equation (7)."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Annotated, Final, Literal, TypeAlias, get_args

from pydantic import Field

from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from flight_model.energy import AirframeParameters
from formation_scenario.battery import EmulatedBattery
from formation_scenario.brought_keys import brought_words
from formation_scenario.fields import (
    MAX_SYSTEM_ID,
    OF_AN_EXTENSION,
    WHOLE,
    Allowed,
    AutopilotParameters,
    Flag,
    Fraction,
    Keys,
    Later,
    NetworkId,
    NonNegative,
    Number,
    Open,
    OwnKeys,
    Positive,
    Speed,
    SystemId,
    Text,
    TimeConstant,
    Word,
    key,
)
from formation_scenario.landing import StoredLanding
from formation_scenario.navigation import Navigation, TrueNavigation
from formation_scenario.signing import Signing

ResponseTime = Annotated[Positive, Field(ge=0.04, le=100.0)]
DeadTime = Annotated[NonNegative, Field(le=2.0)]
Angle = Annotated[Number, Field(ge=-85.0, le=85.0)]
LeastSpeed = Annotated[Number, Field(ge=0.0, le=1e3)]
BASE_PORT = 14550
MAX_CLOCK_S = 4e6
"""MAVLink's time since boot, 32 bits of milliseconds, ends at 4.29e6 s."""
CLOCKS: Final = ("round_trip", *brought_words("telemetry.clock"))
"""How we map vehicles' stamps to one clock ourselves."""
AUTOPILOTS: Final = ("emulator", "arduplane", "arducopter", "px4")
Family = Literal["arduplane", "arducopter", "px4_plane", "px4_copter", "px4_course"]
ARDUPILOTS: Final[dict[str, Family]] = {"arduplane": "arduplane", "arducopter": "arducopter"}
"""Autopilots that are of one family whatever the model is."""
FAMILIES: Final[tuple[str, ...]] = get_args(Family)
Count = Annotated[
    int,
    Field(strict=True, ge=1, le=MAX_SYSTEM_ID),
    WHOLE,
    Allowed(f"1 to {MAX_SYSTEM_ID} on one network; for more give a list, part of it with another `network`"),
]


class EnergyAirframe(Keys):
    """An aircraft under total-energy control; the defaults are ArduPlane's, and its simulator's plane.

    Names in capitals are ArduPilot's parameters.
    """

    kind: Literal["energy"] = key("energy", "total-energy control of speed and height")
    thrust_mps2: Positive = key(14.0, "acceleration by full throttle, m/s²", 10)
    drag_mps2: Positive = key(6.7, "deceleration by parasitic drag at 22 m/s, m/s²", 4)
    induced_drag_mps2: NonNegative = key(0.065, "the same by lift's own drag in level flight, m/s²", 0.5)
    lift_mps2_per_rad: Positive = key(460.0, "acceleration by lift at 22 m/s for a radian of incidence, m/s²", 300)
    throttle_slew_per_s: Positive = key(1.0, "fastest change of throttle (THR_SLEWRATE), 1/s", 0.5)
    bank_lag_s: ResponseTime = key(0.5, "time constant of bank (RLL2SRV_TCONST), s", 0.4)
    pitch_lag_s: ResponseTime = key(0.5, "time constant of pitch (PTCH2SRV_TCONST), s", 0.4)
    rate_lag_s: ResponseTime = key(0.1, "time constant of roll and pitch rates, s", 0.2)
    bank_max_deg: Annotated[Positive, Field(le=85.0)] = key(65.0, "largest bank (ROLL_LIMIT_DEG), degrees", 45)
    heading_gain: Positive = key(math.radians(50.0), "bank for an error of heading (GUIDED_P), rad/rad", 1.2)
    pitch_max_deg: Angle = key(15.0, "largest pitch (TECS_PITCH_MAX), degrees", 20)
    pitch_min_deg: Angle = key(-25.0, "least pitch (PTCH_LIM_MIN_DEG), degrees", -20)
    throttle_cruise: Fraction = key(0.5, "throttle in level flight as assumed by the autopilot (TRIM_THROTTLE)", 0.45)
    airspeed_min_mps: Speed = key(10.0, "the autopilot's least airspeed (AIRSPEED_MIN), m/s", 12)
    airspeed_cruise_mps: Speed = key(22.0, "its cruising airspeed (AIRSPEED_CRUISE), m/s", 20)
    airspeed_max_mps: Speed = key(30.0, "its greatest airspeed (AIRSPEED_MAX), m/s", 28)
    climb_max_mps: Speed = key(5.0, "climb at full throttle as assumed by the autopilot (TECS_CLMB_MAX), m/s", 4)
    sink_min_mps: Speed = key(2.0, "sink without throttle as assumed by the autopilot (TECS_SINK_MIN), m/s", 1.5)
    sink_max_mps: Speed = key(5.0, "fastest sink (TECS_SINK_MAX), m/s", 4)
    time_constant_s: ResponseTime = key(5.0, "time constant of the energy control (TECS_TIME_CONST), s", 3)
    height_lag_s: ResponseTime = key(3.0, "time constant of the demanded height (TECS_HDEM_TCONST), s", 2)
    throttle_damping: NonNegative = key(
        0.5, "gain from errors of the energy's rate to throttle (TECS_THR_DAMP), s", 0.7
    )
    pitch_damping: NonNegative = key(
        0.3, "gain from errors of the energy balance's rate to pitch (TECS_PTCH_DAMP)", 0.5
    )
    integral_gain: NonNegative = key(0.3, "integral gain of both (TECS_INTEG_GAIN), 1/s", 0.1)
    speed_weight: Annotated[NonNegative, Field(le=2.0)] = key(
        1.0, "what pitch controls: 0 height, 2 speed, 1 both (TECS_SPDWEIGHT)", 0.8
    )
    bank_to_throttle: NonNegative = key(10.0, "compensation of a bank's drag by throttle (TECS_RLL2THR), m²/s³", 15)
    vertical_accel_max_mps2: Positive = key(7.0, "largest vertical acceleration (TECS_VERT_ACC), m/s²", 5)
    speed_filter_radps: Positive = key(2.0, "bandwidth of its airspeed estimate (TECS_SPD_OMEGA), rad/s", 1.5)
    airspeed_lag_s: ResponseTime = key(0.28, "time constant of the airspeed's measurement, s", 0.1)
    airspeed_rate_hz: Annotated[Positive, Field(ge=1.0, le=50.0)] = key(
        10.0, "new airspeeds a second in telemetry, Hz", 20
    )
    airspeed_step_mps: NonNegative = key(0.01, "resolution of airspeed in telemetry, m/s", 0.1)
    airspeed_noise_mps: NonNegative = key(
        0.06, "standard deviation of the sensor's white noise, before its lag, m/s", 0.2
    )
    airspeed_scale: Annotated[Positive, Field(ge=0.7, le=1.4)] = key(
        1.0, "ratio of the sensor's reading to equivalent airspeed, by its calibration", 0.95
    )
    dead_time_s: DeadTime = key(0.1, "time from a setpoint's arrival until it acts, s", 0.2)
    spread: Annotated[NonNegative, Field(le=0.3)] = key(
        0.02,
        "standard deviation of differences between aircraft (thrust, drag, lift, time constants), "
        "as a share; drawn by the scenario's seed",
        0.05,
    )

    def parameters(self) -> AirframeParameters:
        """Return the constants of motion and autopilot, SI."""
        keys: dict[str, float] = self.model_dump()
        for name in [name for name in keys if name.endswith("_deg")]:
            keys[f"{name.removesuffix('_deg')}_rad"] = math.radians(keys.pop(name))
        return AirframeParameters(**{each.name: keys[each.name] for each in fields(AirframeParameters)})


ModelParameters: TypeAlias = Annotated[
    Text | OwnKeys, Allowed("the name of a parameter file, or beside aircraft a mapping of its own keys")
]


class VehicleModel(Keys):
    """Autopilot time constants (equation 7) and the limits of flight; defaults: a fixed wing that cruises at 22 m/s."""

    tau_v_s: TimeConstant = key(4.0, "time constant of airspeed, s", 5)
    tau_psi_s: TimeConstant = key(1.5, "time constant of heading, s", 3.4)
    tau_ha_s: TimeConstant = key(1.0, "first time constant of height, s", 1.5)
    tau_hb_s: TimeConstant = key(3.0, "second time constant of height, s", 2)
    dead_time_s: DeadTime = key(
        0.0,
        "time from a setpoint's arrival until the autopilot acts on it, the same for airspeed, heading and height, s; "
        "an airframe's own comes on top",
        0.2,
    )
    speed_min_mps: LeastSpeed = key(16.0, "lowest airspeed, m/s; 0 for vehicles that hover, and only for these", 14)
    speed_max_mps: Speed = key(28.0, "highest airspeed, m/s", 29)
    accel_max_mps2: Positive = key(1.5, "largest change of airspeed, m/s²", 1)
    turn_rate_max_rps: Positive = key(0.25, "highest turn rate, rad/s", 0.2)
    climb_max_mps: Speed = key(3.0, "highest climb and descent rate, m/s", 4)
    hovers: Flag = key(
        False,
        "whether it is a multirotor: it flies the commanded velocity over ground, down to 0, in any "
        "direction; tau_v_s is its time constant in each, and airspeeds above are ground speeds",
        True,
    )
    prompt_share: Annotated[Positive, Field(ge=0.2, le=1.0)] = key(
        1.0,
        "vehicles that hover, and PX4s: share of a change of commanded speed that is flown with the time constant "
        "tau_v_s; the rest follows as the integrator compensates drag",
        0.7,
    )
    rest_s: ResponseTime = key(5.0, "time constant of that rest, s", 9)
    firmware: Literal["ardupilot", "px4"] = key("ardupilot", "emulators: the autopilot that is emulated", "px4")
    airframe: Later[EnergyAirframe] | None = key(
        None,
        "emulators: the aircraft to simulate in place of equation (7), which the keys above then only approximate",
    )
    aircraft: Word = key(None, "the aircraft of an extension that has the keys that aren't given here", "skywalker")
    parameters: ModelParameters | None = key(
        None,
        "a parameter file of the aircraft, ArduPilot's or QGroundControl's, which gives these keys where they are left "
        f"out; emulators answer with it. Beside aircraft: {OF_AN_EXTENSION}",
        "plane.parm",
    )

    def autopilot(self) -> AutopilotModel:
        """Return equation (7) with these keys, as a new object: its time constants may be estimated in flight."""
        limits = self.speed_min_mps, self.speed_max_mps, self.accel_max_mps2, self.turn_rate_max_rps, self.climb_max_mps
        return AutopilotModel(self.tau_v_s, self.tau_psi_s, self.tau_ha_s, self.tau_hb_s, *limits)

    def soon_mps(self, speed_mps: float) -> tuple[float, float]:
        """Return the lowest and the highest airspeed that a vehicle at `speed_mps` can reach within its time constant.

        The share of a fixed wing's integrator isn't counted: it takes longer than bends and transitions to slots.
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

    offset_s: Annotated[Number, Field(ge=0.0, le=MAX_CLOCK_S)] = key(
        0.0, "vehicle's clock minus true time at t = 0, s", 0.25
    )
    drift_ppm: Annotated[Number, Field(ge=-1e5, le=1e5)] = key(
        0.0, "how much faster than true time the vehicle's clock runs, 1e-6", 20
    )
    utc: Flag = key(True, "whether it knows UTC, by its GNSS receiver")
    utc_error_s: Annotated[Number, Field(ge=-1e6, le=1e6)] = key(0.0, "error of its receiver's UTC, s", 0.05)


class OwnEmulator(Keys):
    """An emulated autopilot that an extension registers, in place of the family's own."""

    family: Annotated[str, Open("a family that an extension registers")] = key(..., "its name", "ours")
    parameters: OwnKeys = key(None, OF_AN_EXTENSION, {})


MAX_LINKS: Final = 4
Endpoints: TypeAlias = Annotated[
    Text | Annotated[tuple[Text, ...], Field(min_length=1, max_length=MAX_LINKS)],
    Allowed(f"an endpoint such as udpin:0.0.0.0:14552, or a list of up to {MAX_LINKS}, a link each"),
]


class VehicleCommon(Keys):
    """Keys of a vehicle in the list, and of a group `{count: N}`."""

    network: NetworkId = key(1, "MAVLink network; each has system ids 1 to 254 of its own", 2)
    endpoint: Endpoints = key(
        f"udpin:127.0.0.1:{BASE_PORT}",
        "where the ground station listens, udpin:HOST:PORT, or whom it sends to, udpout:HOST:PORT; or another kind of "
        "[link](links.md). A list: [a link each](links.md#several-links-a-vehicle)",
        "udpin:0.0.0.0:14552",
        derived="udpin:127.0.0.1, one port a network: 14549 + network",
    )
    signing: Signing | None = key(
        None, "signed frames on its own link, which has a key of its own, or none", derived="links.default.signing"
    )
    autopilot: Annotated[str, Open(", ".join(AUTOPILOTS), AUTOPILOTS)] = key(
        "emulator",
        "what flies the vehicle: an emulator, a real autopilot, or one of a family that an extension registers",
    )
    px4_guided: Literal["hold", "course"] = key(
        "hold",
        "PX4 fixed wings: the mode in which they follow, Hold by DO_REPOSITION, or Guided Course, which versions from "
        "1.18 have and which a pilot's Hold takes over",
        "course",
    )
    parameters: OwnKeys = key(None, f"beside autopilot: {OF_AN_EXTENSION}", {})
    model: Model = key(
        VehicleModel(),
        "its autopilot's time constants, and its limits: keys, a vehicle file, or a shipped one by its name",
        derived="the keys' own; with any `autopilot` but `emulator`, the shipped file of that name",
    )
    true_model: Model | None = key(
        None,
        "emulators only: its time constants and limits in truth, where they differ from `model`, "
        "by which the station goes",
        derived="the keys of `model`",
    )
    navigation: Navigation = key(TrueNavigation(), "how well its telemetry knows its state")
    true_navigation: Navigation | None = key(
        None,
        "emulators only: its true errors of telemetry, where they differ from `navigation`, by which the station goes",
        derived="as `navigation`",
    )
    clock: VehicleClock = VehicleClock()
    emulator: OwnEmulator | None = key(None, "emulators only: the autopilot to emulate, of an extension")
    autopilot_parameters: AutopilotParameters = key(
        None,
        "emulators, and simulators of `run --sitl`: parameters with which its autopilot is switched on, such as its "
        "failsafes', by their names; they go before those of its model's file",
        {"FS_GCS_ENABL": 1, "FS_LONG_ACTN": 1},
        derived="the firmware's own, and those of `model.parameters`; of simulators those that suit the scenario",
    )
    landing: StoredLanding | None = key(
        None,
        "emulators of fixed wings, and PX4's simulators of `run --sitl`: the landing in its stored mission, as a "
        "ground station has written it there",
        derived="its mission is empty",
    )
    battery: EmulatedBattery | None = key(
        None,
        "emulators only: its battery, drained by time and throttle",
        derived="it tells 95 % for ever",
    )
    onboard_log: Flag = key(
        False,
        "emulated ArduPilots only: whether it writes a log of its own while armed, which stations can fetch",
        True,
    )

    @property
    def endpoints(self) -> tuple[str, ...]:
        """The endpoint of each of its links, which are numbered from 1 in this order."""
        return (self.endpoint,) if isinstance(self.endpoint, str) else self.endpoint

    @property
    def own_family(self) -> str | None:
        """The emulated family of an extension; None: the one of its `autopilot` and `model`."""
        return None if self.emulator is None else self.emulator.family


class VehicleIdentity(Keys):
    """Keys of a vehicle in the list only. A base of its own, so that these keys come first."""

    id: SystemId = key(..., "MAVLink system id, unique on its network", 2)
    role: Literal["leader", "follower"] = key("follower", "whether it leads at the start; one vehicle may")


class Vehicle(VehicleCommon, VehicleIdentity):
    """One vehicle of the list."""

    @property
    def vehicle_id(self) -> VehicleId:
        """Network and system id."""
        return VehicleId(self.network, self.id)

    @property
    def refs(self) -> tuple[int, str]:
        """What keys may name it by: its id, and "network:id", which is unique even if several networks use the id."""
        return self.id, f"{self.network}:{self.id}"


def family_of(vehicle: VehicleCommon) -> Family:
    """Return the autopilot family of a vehicle; an emulator's is its model's, and so is one's of an extension."""
    named, model = vehicle.autopilot, vehicle.model
    if named in ARDUPILOTS:
        return ARDUPILOTS[named]
    if named == "px4" or model.firmware == "px4":
        if model.hovers:
            return "px4_copter"
        return "px4_plane" if vehicle.px4_guided == "hold" else "px4_course"
    return "arducopter" if model.hovers else "arduplane"


def reads_equivalent_airspeed(vehicle: VehicleCommon) -> bool:
    """Return whether an aircraft reports and takes equivalent airspeeds, as all do but those of equation (7).

    Multirotors use ground velocities.
    """
    model = vehicle.model
    real = vehicle.autopilot != "emulator" or model.firmware == "px4" or model.airframe is not None
    return real and not model.hovers


class VehicleGroup(VehicleCommon):
    """`vehicles: {count: N, ...}`: N identical vehicles, of which vehicle 1 leads."""

    count: Count = key(..., "number of vehicles, the leader included", 20)
