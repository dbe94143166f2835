"""What goes over a vehicle's link, and what of it a radio carries."""

from __future__ import annotations

import itertools
import math

import pytest

from airlink import mavlink as m
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.app.check_budget import budget_report, budget_text, channel_budgets
from gcs_formation.budget.levels import LEVELS
from gcs_formation.budget.traffic import USABLE, Flow, Rates, flight_hz, flows
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from tests.flights.conftest import scenario

PLANE = ArduPlane(2, GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0), 0.25)
ALL_HZ = PLANE.rates_hz(10.0)


def test_in_flight_attitudes_come_half_as_often_and_what_only_a_start_needs_rarely() -> None:
    rates_hz = flight_hz(PLANE, LEVELS[0], ALL_HZ)
    found = {
        m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
        m.MAVLINK_MSG_ID_ATTITUDE: 5.0,
        m.MAVLINK_MSG_ID_SYS_STATUS: 0.1,
    }
    assert {each: rates_hz[each] for each in found} == found


@pytest.mark.parametrize("slow_hz", [2.0, 4.0])
def test_rates_that_are_low_already_stay(slow_hz: float) -> None:
    rates_hz = flight_hz(PLANE, LEVELS[-1], PLANE.rates_hz(slow_hz))
    assert rates_hz[m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT] == rates_hz[m.MAVLINK_MSG_ID_ATTITUDE] == 2.0


def test_each_level_takes_less_than_the_one_before() -> None:
    taken = [
        sum(each.bytes_per_s for each in flows(PLANE, flight_hz(PLANE, level, ALL_HZ), level, 10.0)) for level in LEVELS
    ]
    assert all(less < more for more, less in itertools.pairwise(taken))


def test_a_flow_takes_its_whole_frame() -> None:
    """GLOBAL_POSITION_INT has 28 bytes and a frame's 12 around it."""
    assert Flow(m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, up=False, rate_hz=10.0).bytes_per_s == 400.0


def test_in_half_duplex_both_directions_share_the_time() -> None:
    both = [Flow(m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, up, 10.0) for up in (True, False)]
    assert Rates(1000.0, 2000.0, half_duplex=True).used(both) == pytest.approx(0.6)
    assert Rates(1000.0, 2000.0, half_duplex=False).used(both) == pytest.approx(0.4)


@pytest.mark.parametrize(("rate_kbps", "level", "telemetry_hz"), [(250.0, 0, None), (57.6, 1, 8.0), (19.2, 5, None)])
def test_check_says_at_which_level_a_radio_is_flown_and_which_rates_fit_by_themselves(
    rate_kbps: float, level: int, telemetry_hz: float | None
) -> None:
    links = {"channels": [{"vehicles": "all", "rate_kbps": rate_kbps}]}
    planned = load_scenario(scenario(vehicles={"count": 4}, telemetry={"rate_hz": 10}, links=links))
    (found,) = channel_budgets(planned)
    assert found.level == level
    assert (found.used <= USABLE) == (level == 0)
    assert (None if found.fitting is None else found.fitting[0]) == telemetry_hz
    (said,) = budget_report(planned)["channels"]
    assert said["fits"] == (level == 0)
    assert said["vehicles"] == ["1", "2", "3", "4"]
    if telemetry_hz:
        copied = "\n".join(budget_text(planned))
        assert f"  telemetry: {{rate_hz: {telemetry_hz:g}}}" in copied
        (fits,) = channel_budgets(
            planned.model_copy(update={"telemetry": planned.telemetry.model_copy(update={"rate_hz": telemetry_hz})})
        )
        assert fits.used <= USABLE


def test_check_lists_bytes_by_message_vehicle_and_direction() -> None:
    planned = load_scenario(scenario(vehicles={"count": 2}, telemetry={"rate_hz": 10}))
    vehicles = budget_report(planned)["vehicles"]
    assert set(vehicles) == {"1", "2"}
    assert vehicles["2"]["down"]["GLOBAL_POSITION_INT"] == 400.0
    assert vehicles["2"]["up"]["HEARTBEAT"] == 21.0
    up, down = budget_text(planned)
    assert up.startswith("bytes a second in turns, vehicle 1, 2, each, up ")
    assert "GLOBAL_POSITION_INT 400, VFR_HUD 320" in down
