"""A vehicle's model from a fixed-wing PX4's parameters: the time constants and limits of equation (7).

Time constants are the shipped PX4's, in proportion to the time constants of its controllers. Names since 1.14, and
older ones. Source: PX4 user guide, "Parameter Reference" of 1.15 and 1.10.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from flight_model.energy import GRAVITY_MPS2
from formation_scenario.parameter_files.taking import Taking, wanted
from formation_scenario.source import Key, Plain

AIRSPEED_MIN = wanted(10.0, 0.5, 100.0, "FW_AIRSPD_MIN")
AIRSPEED_MAX = wanted(20.0, 0.5, 100.0, "FW_AIRSPD_MAX")
AIRSPEED_TRIM = wanted(15.0, 0.5, 100.0, "FW_AIRSPD_TRIM")
ROLL_LIMIT = wanted(50.0, 5.0, 85.0, "FW_R_LIM")
CLIMB_MAX = wanted(5.0, 0.1, 50.0, "FW_T_CLMB_MAX")
SINK_MAX = wanted(5.0, 0.1, 50.0, "FW_T_SINK_MAX")
CLIMB_WANTED = wanted(3.0, 0.1, 50.0, "FW_T_CLMB_R_SP")
SINK_WANTED = wanted(2.0, 0.1, 50.0, "FW_T_SINK_R_SP")
HEIGHT_TIME = wanted(5.0, 0.5, 50.0, "FW_T_ALT_TC", "FW_T_TIME_CONST")
SPEED_TIME = wanted(5.0, 0.5, 50.0, "FW_T_TAS_TC", "FW_T_TIME_CONST")
PERIOD = wanted(10.0, 1.0, 100.0, "NPFG_PERIOD", "FW_L1_PERIOD")
AIRSPEEDS: Final = AIRSPEED_MIN, AIRSPEED_MAX
CONCERN_FLIGHT: Final = ("FW_", "NPFG_")
TIME_S, PERIOD_S = 5.0, 10.0
"""Of the shipped time constants."""
MIN_RANGE_MPS: Final = 1.0


def px4_model(take: Taking, shipped: Mapping[str, float]) -> dict[Key, Plain]:
    """Return the model; `shipped` has the keys of the shipped PX4.

    Raises:
        ParameterFileError: a value is out of range, or the airspeeds contradict each other.
    """
    slowest, fastest = take.value(AIRSPEED_MIN, "speed_min_mps"), take.value(AIRSPEED_MAX, "speed_max_mps")
    if fastest - slowest < MIN_RANGE_MPS:
        name = next(each.name for each in AIRSPEED_MAX.names + AIRSPEED_MIN.names if each.name in take.file.parameters)
        raise take.file.refused(name, f"airspeeds of which the greatest ({fastest:g}) is above the least ({slowest:g})")
    take.value(AIRSPEED_TRIM, "the airspeed at which its emulator circles")
    climb = min(take.value(each, "climb_max_mps") for each in (CLIMB_MAX, CLIMB_WANTED))
    sink = min(take.value(each, "climb_max_mps") for each in (SINK_MAX, SINK_WANTED))
    turn_rps = GRAVITY_MPS2 * math.tan(math.radians(take.value(ROLL_LIMIT, "turn_rate_max_rps"))) / fastest
    tau_psi_s = shipped["tau_psi_s"] * take.value(PERIOD, "tau_psi_s") / PERIOD_S
    height = take.value(HEIGHT_TIME, "tau_ha_s, tau_hb_s") / TIME_S
    return {
        "firmware": "px4",
        "tau_v_s": shipped["tau_v_s"] * take.value(SPEED_TIME, "tau_v_s") / TIME_S,
        "prompt_share": shipped["prompt_share"],
        "rest_s": shipped["rest_s"],
        "tau_psi_s": tau_psi_s,
        "tau_ha_s": shipped["tau_ha_s"] * height,
        "tau_hb_s": shipped["tau_hb_s"] * height,
        "speed_min_mps": slowest,
        "speed_max_mps": fastest,
        "accel_max_mps2": shipped["accel_max_mps2"],
        "turn_rate_max_rps": min(turn_rps, 1.0 / tau_psi_s),
        "climb_max_mps": min(climb, sink),
    }
