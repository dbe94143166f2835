"""Setpoints that lead an autopilot's integrator, so that vehicles fly what the law asks for."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.velocity_setpoint import SpeedLead, VelocityLead
from tests.gcs_formation.vehicle.conftest import ORIGIN

PROMPT, REST_S, PERIOD_S = 0.72, 8.9, 0.1
AT_REST = 0.0, 0.0
speeds = st.floats(-3.0, 3.0)


class Integrator:
    """An autopilot that flies a share of the velocity setpoint at once, and the rest with a lag."""

    def __init__(self) -> None:
        self.filled_mps = 0.0

    def flies(self, commanded_mps: float) -> float:
        flown_mps = PROMPT * commanded_mps + (1.0 - PROMPT) * self.filled_mps
        self.filled_mps -= math.expm1(-PERIOD_S / REST_S) * (commanded_mps - self.filled_mps)
        return flown_mps


@given(st.lists(st.tuples(speeds, speeds), min_size=1, max_size=60))
def test_with_a_lead_the_velocity_asked_for_is_flown(asked):
    lead, north, east = VelocityLead(PROMPT, REST_S, 100.0, PERIOD_S), Integrator(), Integrator()
    for north_mps, east_mps in asked:
        told = lead.lead((north_mps, east_mps), AT_REST)
        assert (north.flies(told[0]), east.flies(told[1])) == pytest.approx((north_mps, east_mps), abs=1e-9)


def test_none_is_reported_more_than_the_fastest_and_the_rest_is_made_up_for_later():
    lead, flown = VelocityLead(PROMPT, REST_S, 6.0, PERIOD_S), Integrator()
    speeds_mps = []
    for _ in range(300):
        told = lead.lead((4.0, 4.0), AT_REST)
        assert math.hypot(*told) <= 6.0 + 1e-9
        speeds_mps.append(flown.flies(told[0]))
    assert speeds_mps[0] == pytest.approx(PROMPT * 6.0 / math.sqrt(2.0))
    assert speeds_mps[-1] == pytest.approx(4.0)


@given(st.lists(st.floats(12.0, 18.0), min_size=1, max_size=60))
def test_a_led_airspeed_is_flown_as_asked(asked):
    lead, flown = SpeedLead(PROMPT, REST_S, (-100.0, 100.0), PERIOD_S), Integrator()
    flown.filled_mps = 14.0
    for speed_mps in asked:
        assert flown.flies(lead.lead(speed_mps, 14.0)) == pytest.approx(speed_mps, abs=1e-9)


def test_airspeeds_that_are_reported_keep_the_limits_and_the_rest_is_made_up_for_later():
    lead, flown = SpeedLead(PROMPT, REST_S, (11.0, 15.0), PERIOD_S), Integrator()
    flown.filled_mps = 14.0
    for asked_mps, told_first_mps in ((15.0, 15.0), (11.5, 11.0)):
        told = [lead.lead(asked_mps, 14.0) for _ in range(600)]
        flies_mps = [flown.flies(each) for each in told]
        assert told[0] == told_first_mps
        assert 11.0 <= min(told) <= max(told) <= 15.0
        assert flies_mps[-1] == pytest.approx(asked_mps, abs=0.01)


@given(st.lists(st.floats(9.0, 17.0), min_size=1, max_size=60))
def test_an_airspeed_within_reach_is_flown_at_once_and_none_beyond(asked):
    lead, flown = SpeedLead(PROMPT, REST_S, (11.0, 15.0), PERIOD_S), Integrator()
    flown.filled_mps = 14.0
    lead.lead(14.0, 14.0)
    flown.flies(14.0)
    for asked_mps in asked:
        low_mps, high_mps = lead.within_reach_mps
        flies_mps = flown.flies(lead.lead(asked_mps, 14.0))
        assert flies_mps == pytest.approx(min(max(asked_mps, low_mps), high_mps), abs=1e-9)


def test_after_something_else_has_led_it_a_lead_begins_with_what_it_flies() -> None:
    """After 300 s at 19.5 m/s the integrator holds 19.5: with 15 m/s flown and wanted, 11.3 used to be commanded."""
    lead = SpeedLead(PROMPT, REST_S, (11.0, 20.0), PERIOD_S)
    for _ in range(round(300.0 / PERIOD_S)):
        lead.lead(19.5, 19.5)
    lead.reinitialise()
    assert lead.lead(15.0, 15.0) == pytest.approx(15.0)
    hovering = VelocityLead(PROMPT, REST_S, 20.0, PERIOD_S)
    for _ in range(round(300.0 / PERIOD_S)):
        hovering.lead((5.0, -5.0), AT_REST)
    hovering.reinitialise()
    assert hovering.lead((3.0, 1.0), (3.0, 1.0)) == pytest.approx((3.0, 1.0))


def test_a_lead_that_begins_at_an_airspeed_which_was_never_commanded_begins_with_what_is_wanted() -> None:
    """A PX4 comes out of its take-off with 26 m/s, its throttle's integrator for its trim of 14."""
    lead = SpeedLead(PROMPT, REST_S, (11.0, 20.0), PERIOD_S)
    assert lead.lead(14.5, 26.0) == pytest.approx(14.5)


@given(st.floats(0.85, 1.2), st.lists(st.floats(9.0, 22.0), min_size=1, max_size=40))
def test_a_px4_whose_sensor_reads_wrong_flies_the_true_airspeed_asked_within_what_it_says_is_in_reach(ratio, asked):
    """Its limits and its integrator refer to the sensor's reading: taken for true airspeeds they were out of reach."""
    scale = AirspeedScale(0.0, 11.0, 20.0)
    scale.ratio = ratio
    px4, flown = Px4Plane(7, ORIGIN, 0.25, scale, SpeedLead(PROMPT, REST_S, (11.0, 20.0), PERIOD_S)), Integrator()
    flown.filled_mps = 14.0
    here = FlightState(0.0, 0.0, 100.0, 0.0, 14.0 * ratio, 0.0, 0.0, 0.0)
    px4.setpoint(Setpoint(14.0 * ratio, 0.0, 100.0), here)
    flown.flies(14.0)
    for asked_mps in asked:
        reach_mps = px4.speeds_mps
        assert reach_mps is not None
        (told,) = px4.setpoint(Setpoint(asked_mps, 0.0, 100.0), here)
        flies_mps = ratio * flown.flies(told.param1)
        if reach_mps[0] <= asked_mps <= reach_mps[1]:
            assert flies_mps == pytest.approx(asked_mps, abs=1e-6)
        assert 11.0 <= told.param1 <= 20.0
