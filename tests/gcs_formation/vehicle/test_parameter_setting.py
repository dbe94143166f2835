"""Parameters are set, read back, and some never touched."""

import struct

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import ParamSet, ParamValue
from flight_model.earth import GeodeticOrigin
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.families.px4.copter import Px4Copter
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.parameter_setting import REFUSED, TRIES, Change, ParameterWriter, is_untouched

REAL, INT = m.MAV_PARAM_TYPE_REAL32, m.MAV_PARAM_TYPE_INT32
FASTER = Change("AIRSPEED_MAX", REAL, 20.0, 28.1)
OWNERS = (
    *("FS_GCS_ENABL", "FS_LONG_ACTN", "NAV_DLL_ACT", "COM_OBL_RC_ACT", "FENCE_ENABLE", "GF_ACTION"),
    *("BATT_FS_LOW_ACT", "ARMING_CHECK", "RTL_ALT_M", "THR_FAILSAFE", "BAT_LOW_THR", "CBRK_FLIGHTTERM"),
)
ORIGIN = GeodeticOrigin(0.6, 2.1, 0.0)


def encode(name: str, value: float, kind: int) -> ParamSet:
    return ParamSet(7, 1, name, value, kind)


def writer(*changes: Change) -> ParameterWriter:
    return ParameterWriter(changes, encode, lambda reported: reported.param_value)


def answer(name: str, value: float) -> ParamValue:
    return ParamValue(name, struct.unpack("<f", struct.pack("<f", value))[0], REAL, 1, 65535)


def test_it_is_sent_until_it_is_read_back() -> None:
    setting = writer(FASTER)
    assert setting.take(answer("AIRSPEED_MAX", 28.1), Instant(0)) is None  # before it was sent: of another's list
    assert [each.param_value for each in setting.requests(Instant(0))] == [28.1]
    assert setting.requests(after(Instant(0), 0.5)) == []
    assert len(setting.requests(after(Instant(0), 0.8))) == 1
    assert setting.take(answer("AIRSPEED_MAX", 20.0), Instant(0)) is None
    assert setting.pending == [FASTER]
    assert setting.take(answer("AIRSPEED_MAX", 28.1), Instant(0)) is FASTER
    assert (setting.pending, setting.failed) == ([], [])


def test_one_that_is_refused_or_not_answered_is_given_up() -> None:
    setting = writer(FASTER)
    setting.requests(Instant(0))
    for _ in range(REFUSED):
        setting.take(answer("AIRSPEED_MAX", 20.0), Instant(0))
    assert setting.failed == [FASTER]
    silent = writer(FASTER)
    for attempt in range(TRIES):
        assert len(silent.requests(after(Instant(0), float(attempt)))) == 1
    assert (silent.requests(after(Instant(0), 99.0)), silent.failed) == ([], [FASTER])


@pytest.mark.parametrize("name", OWNERS)
def test_failsafes_fences_and_checks_are_never_touched(name: str) -> None:
    assert is_untouched(name)
    assert writer(Change(name, REAL, 1.0, 0.0)).requests(Instant(0)) == []


@pytest.mark.parametrize("family", [ArduPlane, ArduCopter, Px4Plane, Px4Copter])
def test_what_a_check_asks_for_is_allowed_by_it(family: type[Autopilot]) -> None:
    """In the units of each name, also of names before a version."""
    hovers = family in (ArduCopter, Px4Copter)
    model = VehicleModel(hovers=hovers, speed_min_mps=0.0 if hovers else 16.0)
    asked = 0
    for check in family(3, ORIGIN, 0.25).checks(model, PathPlan(waypoints_m=((0, 0, 100), (900, 0, 100)))):
        one: Check | None = check
        while one is not None:
            if one.asks is not None:
                asked += 1
                assert one.holds(one.asks), one.names
                wrong = next(value for value in (1e9, -1e9) if not one.holds(value))
                assert one.change({one.names[0]: wrong}) == (one.names[0], wrong, one.asks)
            assert one.change({}) is None
            one = one.older
    assert asked >= 3


def test_integers_of_a_px4_are_sent_as_bytes() -> None:
    autopilot = Px4Plane(3, ORIGIN, 0.25)
    sent = autopilot.set_parameter("NAV_X", 5.0, INT)
    assert struct.pack("<f", sent.param_value) == struct.pack("<i", 5)
    assert autopilot.parameter(ParamValue("NAV_X", sent.param_value, INT, 1, 0)) == 5.0
    assert autopilot.set_parameter("FW_X", 5.5, REAL).param_value == 5.5
