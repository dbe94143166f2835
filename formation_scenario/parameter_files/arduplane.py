"""A vehicle's model from ArduPlane's parameters: its limits, and the aircraft under total-energy control to emulate.

Parameters have no mass, thrust or drag. The aircraft is the shipped one, made larger or smaller so that it flies at
its own cruising airspeed what the shipped one does at 22 m/s (drag, lift and induced drag by the squares of airspeed);
its thrust is raised where its climb or its greatest airspeed take more. Names since 4.5, and older ones.
Source: ArduPilot documentation, "Complete Parameter List" of Plane 4.6 and 3.9.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from flight_model.energy import GRAVITY_MPS2, REFERENCE_MPS
from flight_model.frequency_response import slow_taus_s
from formation_scenario.parameter_files.taking import Taking, Wanted, wanted
from formation_scenario.source import Key, Plain
from formation_scenario.vehicles import EnergyAirframe

CM, PERCENT = 0.01, 0.01
AIRSPEED_MIN = wanted(9.0, 5.0, 100.0, "AIRSPEED_MIN", "ARSPD_FBW_MIN")
AIRSPEED_MAX = wanted(22.0, 5.0, 100.0, "AIRSPEED_MAX", "ARSPD_FBW_MAX")
AIRSPEED_CRUISE = wanted(12.0, 5.0, 100.0, "AIRSPEED_CRUISE", ("TRIM_ARSPD_CM", CM))
ROLL_LIMIT = wanted(45.0, 5.0, 85.0, "ROLL_LIMIT_DEG", ("LIM_ROLL_CD", CM))
CLIMB_MAX = wanted(5.0, 0.1, 50.0, "TECS_CLMB_MAX")
SINK_MAX = wanted(5.0, 0.1, 50.0, "TECS_SINK_MAX")
SINK_MIN = wanted(2.0, 0.1, 50.0, "TECS_SINK_MIN")
TIME_CONSTANT = wanted(5.0, 0.5, 30.0, "TECS_TIME_CONST")
GUIDED_P = wanted(5000.0, 100.0, 50000.0, "GUIDED_P")
PITCH_MAX = wanted(20.0, 1.0, 85.0, "PTCH_LIM_MAX_DEG", ("LIM_PITCH_MAX", CM))
TECS_PITCH_MAX = wanted(15.0, 0.0, 85.0, "TECS_PITCH_MAX")
"""0: the limit of the pitch is used."""
SLEW = wanted(1.0, 0.0, 10.0, ("THR_SLEWRATE", PERCENT))
"""Of full throttle a second; 0: no limit."""
AIRFRAME: Final[Mapping[str, Wanted]] = {
    "pitch_min_deg": wanted(-25.0, -85.0, 0.0, "PTCH_LIM_MIN_DEG", ("LIM_PITCH_MIN", CM)),
    "throttle_cruise": wanted(0.45, 0.0, 1.0, ("TRIM_THROTTLE", PERCENT)),
    "bank_lag_s": wanted(0.5, 0.04, 5.0, "RLL2SRV_TCONST"),
    "pitch_lag_s": wanted(0.5, 0.04, 5.0, "PTCH2SRV_TCONST"),
    "height_lag_s": wanted(3.0, 0.04, 30.0, "TECS_HDEM_TCONST"),
    "throttle_damping": wanted(0.5, 0.0, 10.0, "TECS_THR_DAMP"),
    "pitch_damping": wanted(0.3, 0.0, 10.0, "TECS_PTCH_DAMP"),
    "integral_gain": wanted(0.3, 0.0, 10.0, "TECS_INTEG_GAIN"),
    "speed_weight": wanted(1.0, 0.0, 2.0, "TECS_SPDWEIGHT"),
    "bank_to_throttle": wanted(10.0, 0.0, 100.0, "TECS_RLL2THR"),
    "vertical_accel_max_mps2": wanted(7.0, 0.5, 50.0, "TECS_VERT_ACC"),
    "speed_filter_radps": wanted(2.0, 0.1, 20.0, "TECS_SPD_OMEGA"),
}
"""Keys of `airframe` that are a parameter each."""
AIRSPEEDS: Final = AIRSPEED_MIN, AIRSPEED_MAX, AIRSPEED_CRUISE
"""A file with none of these isn't an ArduPlane's."""
CONCERN_FLIGHT: Final = (
    "AIRSPEED_", "ARSPD_FBW", "LIM_", "NAVL1_", "PTCH2SRV_", "PTCH_", "RLL2SRV_", "ROLL_LIMIT", "STALL_", "TECS_",
    "THR_M", "TRIM_A", "TRIM_T",
)  # fmt: skip
"""Beginnings of the names of others that make a difference to how one flies."""
GUIDED_SHARE: Final = 0.636 / math.radians(50.0)
"""The shipped aircraft's gain as it was identified, by GUIDED_P: one that slips turns less than its bank would."""
LEAD_RAD: Final = 1.0
"""Largest lead of the heading setpoint in a turn, time constant times turn rate, that GUIDED's gain leaves."""
GAIN_SHARE, LOSS_SHARE = 0.45, 1.1
"""Accelerations as shares of what climb and sink leave; the shipped aircraft's, 1 m/s², is 0.9 of TECS' own half."""
THRUST_SHARE: Final = 1.15
"""Thrust over what the greatest airspeed, and the steepest climb, take; aircraft differ by some percent."""
MIN_RANGE_MPS: Final = 1.0


def arduplane_model(take: Taking, aircraft: Mapping[str, float]) -> dict[Key, Plain]:
    """Return the model; `aircraft` has the keys of the airframe that is made larger.

    Time constants are those of slow changes.

    Raises:
        ParameterFileError: a value is out of range, or the airspeeds contradict each other.
    """
    slowest, fastest = take.value(AIRSPEED_MIN, "speed_min_mps"), take.value(AIRSPEED_MAX, "speed_max_mps")
    cruise = take.value(AIRSPEED_CRUISE, "airframe.airspeed_cruise_mps")
    if fastest - slowest < MIN_RANGE_MPS:
        name = next(each.name for each in AIRSPEED_MAX.names + AIRSPEED_MIN.names if each.name in take.file.parameters)
        raise take.file.refused(name, f"airspeeds of which the greatest ({fastest:g}) is above the least ({slowest:g})")
    cruise = min(max(cruise, slowest), fastest)
    climb, sink = take.value(CLIMB_MAX, "climb_max_mps"), take.value(SINK_MAX, "climb_max_mps")
    bank_deg = take.value(ROLL_LIMIT, "turn_rate_max_rps")
    tecs_s = take.value(TIME_CONSTANT, "airframe.time_constant_s")
    min_sink = take.value(SINK_MIN, "airframe.sink_min_mps")
    gain = GUIDED_SHARE * math.radians(CM * take.value(GUIDED_P, "airframe.heading_gain"))
    turn_rps = GRAVITY_MPS2 * math.tan(math.radians(bank_deg)) / fastest
    airframe: dict[Key, Plain] = {key: take.value(each, f"airframe.{key}") for key, each in AIRFRAME.items()}
    airframe |= {
        "heading_gain": gain,
        "bank_max_deg": bank_deg,
        "pitch_max_deg": _pitch_max_deg(take),
        "throttle_slew_per_s": take.value(SLEW, "airframe.throttle_slew_per_s") or SLEW.maximum,
        "airspeed_min_mps": slowest,
        "airspeed_cruise_mps": cruise,
        "airspeed_max_mps": fastest,
        "climb_max_mps": climb,
        "sink_min_mps": min_sink,
        "sink_max_mps": sink,
        "time_constant_s": tecs_s,
        **_as_large(cruise, fastest, climb, aircraft),
    }
    speed_s, heading_s, height_s = slow_taus_s(EnergyAirframe.model_validate(airframe).parameters(), cruise)
    return {
        "tau_v_s": speed_s,
        "tau_psi_s": heading_s,
        "tau_ha_s": height_s / 2.0,
        "tau_hb_s": height_s / 2.0,
        "speed_min_mps": slowest,
        "speed_max_mps": fastest,
        "accel_max_mps2": min(GAIN_SHARE * climb, LOSS_SHARE * min_sink) * GRAVITY_MPS2 / cruise,
        "turn_rate_max_rps": min(turn_rps, LEAD_RAD / heading_s),
        "climb_max_mps": min(climb, sink),
        "airframe": airframe,
    }


def _pitch_max_deg(take: Taking) -> float:
    limit_deg = take.value(PITCH_MAX, "airframe.pitch_max_deg")
    own_deg = take.value(TECS_PITCH_MAX, "airframe.pitch_max_deg")
    return min(own_deg, limit_deg) if own_deg > 0.0 else limit_deg


def _as_large(cruise: float, fastest: float, climb: float, shipped: Mapping[str, float]) -> dict[Key, Plain]:
    """Return thrust, drag and lift of the shipped aircraft, made to cruise at another airspeed."""
    scale = (cruise / REFERENCE_MPS) ** 2
    drag, induced = shipped["drag_mps2"] / scale, shipped["induced_drag_mps2"] * scale
    max_drag = drag * (fastest / REFERENCE_MPS) ** 2 + induced * (REFERENCE_MPS / fastest) ** 2
    climbs = shipped["drag_mps2"] + shipped["induced_drag_mps2"] + GRAVITY_MPS2 * climb / cruise
    return {
        "thrust_mps2": max(shipped["thrust_mps2"], THRUST_SHARE * max_drag, THRUST_SHARE * climbs),
        "drag_mps2": drag,
        "induced_drag_mps2": induced,
        "lift_mps2_per_rad": shipped["lift_mps2_per_rad"] / scale,
    }
