"""What autopilots say of their own estimates."""

import math

import pytest

from airlink.clock import Instant, after
from airlink.messages import EKF_READY
from airlink.messages.system import Statustext
from airlink.messages.telemetry import EkfStatusReport, EstimatorStatus
from flight_model.earth import GeodeticOrigin
from gcs_formation.features.telemetry_health.estimator_report import EstimatorReport
from gcs_formation.vehicle.telemetry import Telemetry

ABSOLUTE, CONSTANT = 16, 128


def ardupilot(flags=EKF_READY, velocity=0.1, position=0.1, height=0.1):
    return EkfStatusReport(flags, velocity, position, height, 0.1, 0.0)


def px4(flags=EKF_READY, velocity=0.1, position=0.1, height=0.1):
    return EstimatorStatus(0, flags, velocity, position, height, 0.1, 0.0, 0.0, 1.0, 1.0)


@pytest.fixture
def say():
    """Return what takes messages, a second after another, and returns what is found then."""
    report, seen = EstimatorReport(), Telemetry(GeodeticOrigin(0.6, 2.1, 0.0))
    at_s = 0.0

    def said(*messages):
        nonlocal at_s
        for message in messages:
            at_s += 1.0
            seen.store(message)
            report.take(seen, after(Instant(0), at_s))
        return report

    return said


@pytest.mark.parametrize("status", [ardupilot, px4])
@pytest.mark.parametrize("flags", [EKF_READY & ~ABSOLUTE, EKF_READY | CONSTANT])
def test_an_estimator_that_loses_its_absolute_position_isnt_flown_by_until_it_has_it_again(say, status, flags):
    assert not say(status(flags)).lost, "it never had one: that is the start-up's to wait for"
    assert not say(status()).lost
    assert say(status(flags)).lost
    assert "no absolute position" in say(status(flags)).findings()["position"]
    assert not say(status()).lost


@pytest.mark.parametrize("status", [ardupilot, px4])
@pytest.mark.parametrize("quantity", ["velocity", "position", "height"])
def test_what_it_rejects_twice_in_a_row_is_said(say, status, quantity):
    assert say(status(**{quantity: 1.4}), status(), status(**{quantity: 1.4})).findings() == {}
    found = say(status(**{quantity: 1.5})).findings()
    assert list(found) == [quantity]
    assert "1.5 times their gate" in found[quantity]
    assert say(status(**{quantity: math.nan})).findings() == {}


def test_a_switch_of_lanes_explains_what_jumps_in_the_next_seconds(say):
    assert say(Statustext(2, "EKF3 lane switch 1")).switched == "EKF3 lane switch 1"
    assert say(*(Statustext(6, "hello") for _ in range(6))).switched == ""
