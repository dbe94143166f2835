"""How fixed wings take off, from the ground to where their autopilot's ordinary flight begins.

Source: take-offs of ArduPlane 4.7's and PX4 1.17's simulated planes (docs/real-autopilots.md). One whose scenario names
no aircraft rolls and climbs by equation (7) and its limits.
"""

from __future__ import annotations

from typing import Final

from flight_model.autopilot_model import AutopilotModel
from formation_scenario.vehicles import VehicleModel

LIFT_OFF_SHARE: Final = 0.7
"""Share of the lowest airspeed at which a vehicle lifts off."""
AIRFRAMES_SHARE: Final = 0.88
"""The same of an airframe's cruising airspeed: an ArduPlane pitches up 3.7 s after arming, at 19 to 20 m/s."""
PX4S_SHARE: Final = 0.8
"""The same of a PX4's highest airspeed: 16 m/s, 2.4 s after arming."""
PX4S_CLIMB_SHARE: Final = 0.9
"""Share of its highest airspeed at which a PX4 climbs with full throttle: 18 m/s."""
PX4S_ACCEL_MPS2, PX4S_LAG_S, PX4S_CLIMB_MPS = 8.0, 0.5, 4.9


def lift_off_mps(model: VehicleModel) -> float:
    """Return the airspeed at which a fixed wing leaves the ground."""
    if model.airframe is not None:
        return AIRFRAMES_SHARE * model.airframe.airspeed_cruise_mps
    if model.firmware == "px4":
        return PX4S_SHARE * model.speed_max_mps
    return LIFT_OFF_SHARE * model.speed_min_mps


def full_throttle_model(model: VehicleModel) -> AutopilotModel | None:
    """Return by what a PX4 without an airframe takes off, whose highest airspeed it keeps; None for all others."""
    if model.firmware != "px4" or model.airframe is not None:
        return None
    climbs = model.autopilot()
    climbs.tau_v_s, climbs.accel_max_mps2, climbs.climb_max_mps = PX4S_LAG_S, PX4S_ACCEL_MPS2, PX4S_CLIMB_MPS
    climbs.speed_max_mps *= PX4S_CLIMB_SHARE
    return climbs
