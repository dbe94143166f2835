"""Parameters: which are read, which values are reported, and which keep all vehicles on the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import CommandInt, ParamValue
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.vehicle.checks import AT_ONCE, RETRY_S, TRIES, Finding, ParameterReader
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.families.px4.copter import Px4Copter
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.own_fence import FENCE_NAMES
from tests.gcs_formation.vehicle.conftest import ORIGIN, planned

MODEL, PATH = planned(22.0, 80.0, speed_min_mps=14.0, speed_max_mps=29.0, turn_rate_max_rps=0.25, accel_max_mps2=1.5)
IN_ORDER = {
    "MAV_GCS_SYSID": 255,
    "FS_GCS_ENABL": 1,
    "FS_LONG_ACTN": 1,
    "FS_LONG_TIMEOUT": 5,
    "TKOFF_ALT": 50,
    "AIRSPEED_MIN": 14,
    "AIRSPEED_MAX": 29,
    "AIRSPEED_CRUISE": 22,
    "ROLL_LIMIT_DEG": 45,
    "TECS_CLMB_MAX": 5,
    "TECS_SINK_MAX": 5,
    **dict.fromkeys(FENCE_NAMES, 0),
    "AUTOLAND_WP_ALT": 55,
}
NOW = ("AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG")
START, PLANE = Instant(0), ArduPlane(2, ORIGIN, 0.25)


def reported(reader: ParameterReader, values: Mapping[str, float], now: Instant = START) -> None:
    for name, value in values.items():
        reader.receive_parameter(ParamValue(name, value, m.MAV_PARAM_TYPE_REAL32, 1400, 65535), now)


def findings(**changed: float) -> list[Finding]:
    reader = ParameterReader(2, PLANE.checks(MODEL, PATH))
    reported(reader, IN_ORDER | changed)
    assert reader.complete
    return reader.findings()


def test_parameters_as_they_should_be_are_no_findings() -> None:
    assert findings() == []


@pytest.mark.parametrize(
    ("name", "value", "allowed", "refuses"),
    [
        ("MAV_GCS_SYSID", 250, "255, this ground station", True),
        ("FS_GCS_ENABL", 0, "1 or 2;", False),
        ("FS_GCS_ENABL", 3, "1 or 2;", False),
        ("FS_LONG_ACTN", 0, "1 (RTL), 4 (AUTO) or 5 (AUTOLAND)", False),
        ("FS_LONG_TIMEOUT", 1, "3 s or more", False),
        ("TKOFF_ALT", 40, "50 m or more", True),
        ("AIRSPEED_MIN", 16, "up to 14 m/s", False),
        ("AIRSPEED_MIN", 23, "up to 14 m/s", True),
        ("AIRSPEED_MAX", 28, "29 m/s or more", False),
        ("AIRSPEED_MAX", 21, "29 m/s or more", True),
        ("AIRSPEED_CRUISE", 18, "22 m/s, path.speed_mps", False),
        ("ROLL_LIMIT_DEG", 25, "29 degrees or more", False),  # atan(22 * 0.25 / 9.81) = 29.3 degrees
        ("ROLL_LIMIT_DEG", 0, "29 degrees or more", True),
        ("ROLL_LIMIT_DEG", -5, "29 degrees or more", True),
        ("TECS_CLMB_MAX", 0, "3 m/s or more", True),
        ("TECS_SINK_MAX", -1, "3 m/s or more", True),
    ],
)
def test_a_parameter_that_is_not_as_it_should_be_is_named_with_what_is_allowed(
    name: str, value: float, allowed: str, refuses: bool
) -> None:
    (finding,) = findings(**{name: value})
    assert finding.text.startswith(f"{name}: found {value}; allowed: {allowed}")
    assert finding.refuses == refuses


def test_a_parameter_is_read_by_whichever_of_its_names_the_version_knows() -> None:
    reader = ParameterReader(2, PLANE.checks(MODEL, PATH))
    others: dict[str, float] = {name: value for name, value in IN_ORDER.items() if name != "MAV_GCS_SYSID"}
    reported(reader, {**others, "SYSID_MYGCS": 1})
    (finding,) = reader.findings()
    assert reader.complete
    assert finding.text.startswith("SYSID_MYGCS: found 1; allowed: 255")


def test_requests_come_a_few_at_once_and_the_next_ones_as_soon_as_those_are_answered() -> None:
    reader, asked, now = ParameterReader(2, PLANE.checks(MODEL, PATH)), list[str](), START
    while requests := reader.requests(now):
        assert len(requests) <= AT_ONCE
        assert {request.target_system for request in requests} == {2}
        asked += [request.param_id for request in requests]
        reported(reader, {request.param_id: IN_ORDER.get(request.param_id, 255) for request in requests}, now)
    assert sorted(asked) == sorted([*IN_ORDER, "SYSID_MYGCS"])


def test_what_is_lost_is_asked_for_again_and_what_never_comes_is_named() -> None:
    reader, tries, now = ParameterReader(2, PLANE.checks(MODEL, PATH)), 0, START
    while not reader.complete:
        tries += sum(request.param_id == "TKOFF_ALT" for request in reader.requests(now))
        reported(reader, {name: value for name, value in IN_ORDER.items() if name != "TKOFF_ALT"}, now)
        now = after(now, RETRY_S)
    assert tries == TRIES
    assert reader.findings() == [Finding("no answer for TKOFF_ALT, not checked")]


def test_a_parameter_of_what_older_versions_lack_is_not_missed() -> None:
    reader, now = ParameterReader(2, PLANE.checks(MODEL, PATH)), START
    while not reader.complete:
        reader.requests(now)
        reported(reader, {name: value for name, value in IN_ORDER.items() if name != "AUTOLAND_WP_ALT"}, now)
        now = after(now, RETRY_S)
    assert reader.findings() == []


def test_parameters_that_none_asked_for_are_ignored() -> None:
    reader = ParameterReader(2, PLANE.checks(MODEL, PATH))
    reported(reader, {f"OTHER_{number}": 1.0 for number in range(1000)})
    assert not reader.complete
    assert len(reader._values) == 0


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_not_read_and_named_as_such(value: float) -> None:
    reader, asked, now = ParameterReader(2, PLANE.checks(MODEL, PATH)), 0, START
    while not reader.complete:
        asked += sum(request.param_id == "ROLL_LIMIT_DEG" for request in reader.requests(now))
        reported(reader, IN_ORDER | {"ROLL_LIMIT_DEG": value}, now)
        now = after(now, RETRY_S)
    assert asked == TRIES
    assert "ROLL_LIMIT_DEG" not in reader.values
    assert reader.bounds() == []
    assert reader.findings() == [Finding("no answer for ROLL_LIMIT_DEG or LIM_ROLL_CD, not checked")]


def test_a_value_that_is_not_finite_leaves_the_one_that_was_read() -> None:
    reader = ParameterReader(2, PLANE.checks(MODEL, PATH))
    reported(reader, IN_ORDER)
    reported(reader, {"ROLL_LIMIT_DEG": math.nan})
    assert reader.values["ROLL_LIMIT_DEG"] == 45


def test_an_older_arduplanes_limits_are_read_by_their_names_and_units_before_4_5() -> None:
    older = {"ARSPD_FBW_MIN": 14, "ARSPD_FBW_MAX": 29, "TRIM_ARSPD_CM": 2200, "LIM_ROLL_CD": 4500}
    others: dict[str, float] = {name: value for name, value in IN_ORDER.items() if name not in NOW}
    for changed, found in (({}, []), ({"LIM_ROLL_CD": 2000}, ["LIM_ROLL_CD: found 2000"])):
        reader = ParameterReader(2, PLANE.checks(MODEL, PATH))
        reported(reader, others)
        now = START
        while not reader.complete:
            for request in reader.requests(now):
                if request.param_id in older:
                    reported(reader, {request.param_id: (older | changed)[request.param_id]}, now)
            now = after(now, RETRY_S)
        assert [each.text.partition(";")[0] for each in reader.findings()] == found


def test_old_names_are_not_asked_for_where_the_present_ones_are_answered() -> None:
    reader, asked, now = ParameterReader(2, PLANE.checks(MODEL, PATH)), set[str](), START
    for _ in range(2):
        asked |= {request.param_id for request in reader.requests(now)}
        reported(reader, {name: IN_ORDER[name] for name in asked & set(IN_ORDER)}, now)
        now = after(now, RETRY_S)
    assert not asked & {"ARSPD_FBW_MIN", "ARSPD_FBW_MAX", "TRIM_ARSPD_CM", "LIM_ROLL_CD"}


@pytest.mark.parametrize("field_m", [None, 1600.0])
def test_airspeeds_are_commanded_within_what_the_vehicle_tells(field_m: float | None) -> None:
    """At 1600 m a reading of 24 m/s is 25.9 m/s true."""
    scale = None if field_m is None else AirspeedScale(field_m, 16.0, 28.0)
    plane = ArduPlane(1, GeodeticOrigin(0.5, 0.5, 0.0), 0.25, scale)
    plane.bound_speeds(18.0, 24.0)
    where = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)
    sent = [plane.setpoint(Setpoint(speed_mps, 0.0, 100.0), where)[0] for speed_mps in (10.0, 20.0, 30.0)]
    assert [each.param2 for each in sent if isinstance(each, CommandInt)] == pytest.approx(
        [18.0, 20.0 if scale is None else 20.0 / scale.ratio, 24.0]
    )
    assert plane.speeds_mps is not None
    assert plane.speeds_mps[1] == 24.0


@pytest.mark.parametrize(
    ("name", "value", "bound"),
    [
        ("AIRSPEED_MAX", 24.0, ("speed_max_mps", 24.0)),
        ("ARSPD_FBW_MAX", 24.0, ("speed_max_mps", 24.0)),
        ("AIRSPEED_MIN", 18.0, ("speed_min_mps", 18.0)),
        ("LIM_ROLL_CD", 2000.0, ("turn_rate_max_rps", math.tan(math.radians(20.0)) * 9.80665 / 22.0)),
        ("AIRSPEED_MAX", 40.0, None),
        ("TECS_CLMB_MAX", 2.0, ("climb_max_mps", 2.0)),
        ("TECS_SINK_MAX", 1.5, ("climb_max_mps", 1.5)),
        ("TECS_CLMB_MAX", 3.0, None),
        ("TECS_CLMB_MAX", 0.0, None),
        ("TECS_SINK_MAX", -1.0, None),
        ("ROLL_LIMIT_DEG", 0.0, None),
        ("LIM_ROLL_CD", -100.0, None),
    ],
)
def test_parameters_narrower_than_the_model_bound_it(name: str, value: float, bound: tuple[str, float] | None) -> None:
    found = [check.bound({name: value}) for check in PLANE.checks(MODEL, PATH)]
    assert [each[:2] for each in found if each is not None] == (
        [] if bound is None else [(bound[0], pytest.approx(bound[1], rel=1e-3))]
    )


LARGEST = 3.4e38
"""Near the largest 32-bit float."""


@pytest.mark.parametrize("value", [LARGEST, -LARGEST])
def test_a_fence_or_failsafe_of_a_number_that_is_none_of_its_choices_is_read_all_the_same(value: float) -> None:
    assert PLANE.own_fence({"FENCE_ENABLE": 1.0, "FENCE_TYPE": value}) is not None
    assert PLANE.own_failsafe({"FS_GCS_ENABL": 1.0, "FS_LONG_ACTN": value}) is not None
    assert ArduCopter(2, ORIGIN, 0.5).own_failsafe({"FS_GCS_ENABLE": value}) is not None
    assert Px4Plane(2, ORIGIN, 0.25).own_failsafe({"NAV_DLL_ACT": value}) is None
    assert Px4Copter(2, ORIGIN, 0.5).own_failsafe({"COM_OBL_RC_ACT": value}) is not None
