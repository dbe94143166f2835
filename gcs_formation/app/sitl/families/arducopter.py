"""ArduCopter's simulator, with its quadrotor."""

from __future__ import annotations

from typing import Final

from formation_scenario import Scenario, Vehicle
from gcs_formation.app.sitl.ardupilot import CALIBRATED, ArduPilotSimulator
from gcs_formation.app.sitl.simulator import endurance_s

COMPASS: Final = {
    f"COMPASS_OFS{which}_{axis}": value for which in ("", 2, 3) for axis, value in zip("XYZ", (5, 13, -18), strict=True)
}
TRANSMITTER: Final = {
    f"RC{channel}_{end}": value for channel in range(1, 9) for end, value in (("MIN", 1000), ("MAX", 2000))
}
CURRENT_A: Final = 30.0
"""That its quadrotor draws in flight. Measured: 27 to 35 A."""
MAH: Final = 1000.0 / 3600.0
"""Of a current of 1 A during 1 s."""


class ArduCopterSimulator(ArduPilotSimulator):
    """`arducopter --model +`."""

    name = "arducopter"
    model = "+"
    step_s = 0.00125  # its gyros must be 1.8 times as fast as its main loop of 400 Hz (`PreArm: Gyro 0 rate …`)
    own = (
        CALIBRATED | COMPASS | TRANSMITTER | {"FRAME_CLASS": 1, "FRAME_TYPE": 0, "FS_THR_ENABLE": 0, "BATT_MONITOR": 4}
    )

    def _of_scenario(self, vehicle: Vehicle, scenario: Scenario) -> dict[str, float]:
        model = vehicle.model
        return {
            "FS_GCS_ENABLE": 1,
            "BATT_CAPACITY": round(MAH * CURRENT_A * endurance_s(scenario)),
            "WP_SPD": model.speed_max_mps,
            "WP_ACC": model.accel_max_mps2,
            "WPNAV_SPEED": 100.0 * model.speed_max_mps,  # before 4.7, in cm/s
            "WPNAV_ACCEL": 100.0 * model.accel_max_mps2,
        }


SIMULATOR: Final = ArduCopterSimulator()
