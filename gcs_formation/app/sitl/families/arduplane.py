"""ArduPlane's simulator, with its fixed wing of 2 kg."""

from __future__ import annotations

import math
from typing import Final

from formation_scenario import Scenario, Vehicle
from gcs_formation.app.sitl.ardupilot import CALIBRATED, ArduPilotSimulator

GRAVITY_MPS2: Final = 9.81
BANK_TO_SPARE_DEG: Final = 10.0
MIN_BANK_DEG: Final = 45.0
MIN_MAX_MPS, MAX_MIN_MPS = 30.0, 10.0
"""AIRSPEED_MAX and AIRSPEED_MIN unless the model flies beyond."""


class ArduPlaneSimulator(ArduPilotSimulator):
    """`arduplane --model plane`."""

    name = "arduplane"
    model = "plane"
    own = CALIBRATED | {
        "ARSPD_USE": 1,
        "TRIM_THROTTLE": 50,
        "RC3_MIN": 1000,
        "RC3_MAX": 2000,
        "RC3_TRIM": 1000,
        "SERVO3_MIN": 1000,
        "SERVO3_MAX": 2000,
    }

    def _of_scenario(self, vehicle: Vehicle, scenario: Scenario) -> dict[str, float]:
        model, cruise_mps = vehicle.model, scenario.path.begin_mps
        bank_deg = math.degrees(math.atan(model.speed_max_mps * model.turn_rate_max_rps / GRAVITY_MPS2))
        return {
            "FS_GCS_ENABL": 1,
            "FS_LONG_ACTN": 1,
            "TKOFF_ALT": 50,
            "WP_LOITER_RAD": 80,
            "AIRSPEED_CRUISE": cruise_mps,
            "AIRSPEED_MIN": math.floor(min(model.speed_min_mps, MAX_MIN_MPS)),
            "AIRSPEED_MAX": math.ceil(max(model.speed_max_mps, MIN_MAX_MPS)),
            "ROLL_LIMIT_DEG": math.ceil(max(bank_deg + BANK_TO_SPARE_DEG, MIN_BANK_DEG)),
        }


SIMULATOR: Final = ArduPlaneSimulator()
