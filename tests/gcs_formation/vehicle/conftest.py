"""An ArduPlane as the ground station sees it, fed with messages."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from airlink import mavlink as m
from airlink.messages import EKF_READY
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, EkfStatusReport, GlobalPositionInt, SysStatus, VfrHud
from flight_model.earth import GeodeticOrigin
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.telemetry import Telemetry

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 20.0)


def planned(speed_mps: float, lowest_m: float, **model: float) -> tuple[VehicleModel, PathPlan]:
    """Return the model of a vehicle, and a path at this speed with this lowest height."""
    places = ((0.0, 0.0, lowest_m + 20.0), (1000.0, 0.0, lowest_m), (2000.0, 0.0, lowest_m + 10.0))
    return VehicleModel.model_validate(model), PathPlan(speed_mps=speed_mps, waypoints_m=places)


def heartbeat(mode: int, *, armed: bool, status: int = m.MAV_STATE_STANDBY) -> Heartbeat:
    base = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (m.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, base, mode, status)


def position(above_home_m: float, stamp_s: float = 1.0) -> GlobalPositionInt:
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(0.0, 0.0, -above_home_m)
    return GlobalPositionInt(stamp_s, lat_rad, lon_rad, alt_m, above_home_m, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def plane() -> ArduPlane:
    return ArduPlane(7, ORIGIN, 0.25)


@pytest.fixture
def telemetry() -> Telemetry:
    return Telemetry(ORIGIN)


@pytest.fixture
def tell(telemetry: Telemetry) -> Callable[..., None]:
    """Return a function that feeds mode and height, and everything else that telemetry and readiness need."""

    def told(mode: int, *, armed: bool = False, above_home_m: float = 0.0, status: int = m.MAV_STATE_STANDBY) -> None:
        for message in (
            heartbeat(mode, armed=armed, status=status),
            position(above_home_m),
            Attitude(1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
            VfrHud(22.0, 22.0, 0.5, 50, above_home_m, 0.0),
            EkfStatusReport(EKF_READY, 0.0, 0.0, 0.0, 0.0, 0.0),
            SysStatus(0, 0, m.MAV_SYS_STATUS_PREARM_CHECK),
        ):
            telemetry.store(message)

    return told
