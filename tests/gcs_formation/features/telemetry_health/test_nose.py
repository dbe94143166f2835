"""A multirotor's heading against its yaw rate and the heading in its positions; not flown."""

import math

import pytest

from airlink.messages.telemetry import Attitude
from gcs_formation.features.telemetry_health.nose import NoseCheck

STEP_S, TURN_RPS, TURN_MAX_RPS = 0.1, 0.4, 0.6


def wrapped(angle_rad):
    return math.remainder(angle_rad, math.tau)


class Turning:
    """A multirotor that turns steadily; what it says of its heading can be altered from 4 s on."""

    def __init__(self, *, hdg=True):
        self.checked, self.tells_hdg = NoseCheck(TURN_MAX_RPS), hdg
        self.found_s, self.off_rad = None, []

    def fly(self, seconds, yaw_of=lambda truth, _s: truth, hdg_of=lambda truth, _s: truth, rate_of=lambda rate: rate):
        for tick in range(round(seconds / STEP_S)):
            time_s = 10.0 + tick * STEP_S
            truth, since_s = TURN_RPS * (time_s - 10.0), time_s - 14.0
            yaw, hdg = (of(truth, since_s) if since_s >= 0.0 else truth for of in (yaw_of, hdg_of))
            rate = rate_of(TURN_RPS) if since_s >= 0.0 else TURN_RPS
            attitude = Attitude(time_s, 0.0, 0.0, wrapped(yaw), 0.0, 0.0, rate)
            told = hdg % math.tau if self.tells_hdg else math.nan
            self.off_rad.append(abs(wrapped(self.checked.take(attitude, told, time_s) - truth)))
            if self.found_s is None and self.checked.finding:
                self.found_s = since_s
        return self


def test_a_true_heading_is_flown_by_through_turns_without_end():
    flown = Turning().fly(120.0)
    assert flown.found_s is None
    assert max(flown.off_rad) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("hdg", [True, False])
def test_a_jump_of_the_attitude_is_taken_out_at_once(hdg):
    flown = Turning(hdg=hdg).fly(20.0, yaw_of=lambda truth, _s: truth + 0.5)
    assert flown.found_s == pytest.approx(0.0, abs=1e-6)
    assert max(flown.off_rad) < 0.01


def test_an_estimate_that_jumps_in_both_messages_is_taken_to_be_as_before():
    flown = Turning().fly(20.0, *[lambda truth, _s: truth - 0.5] * 2)
    assert "jumped by 29°" in flown.checked.finding
    assert max(flown.off_rad) < 0.01


@pytest.mark.parametrize(
    "yaw_of",
    [
        lambda _truth, _s: TURN_RPS * 4.0,  # frozen
        lambda truth, s: truth + 0.2 * s,  # drifting
        lambda truth, _s: -truth,
        lambda truth, _s: 0.3 * truth,
        lambda _truth, _s: 0.0,
    ],
)
def test_an_attitude_that_contradicts_the_heading_of_positions_is_flown_without(yaw_of):
    flown = Turning().fly(20.0, yaw_of)
    assert flown.found_s < 2.0
    assert max(flown.off_rad[-100:]) < 0.01


def test_a_heading_that_is_frozen_turns_at_its_yaw_rate():
    flown = Turning(hdg=False).fly(20.0, yaw_of=lambda _truth, _s: TURN_RPS * 4.0)
    assert flown.found_s < 1.0
    assert max(flown.off_rad[-100:]) < 0.1


def test_an_estimate_that_is_frozen_in_both_messages_turns_at_its_yaw_rate():
    flown = Turning().fly(20.0, yaw_of=lambda _truth, _s: TURN_RPS * 4.0, hdg_of=lambda _t, _s: TURN_RPS * 4.0)
    assert "doesn't turn at its yaw rate" in flown.checked.finding
    assert max(flown.off_rad[-100:]) < 0.1


def test_positions_whose_heading_jumps_leave_the_attitude_believed():
    flown = Turning().fly(20.0, hdg_of=lambda truth, _s: truth + 1.0)
    assert "heading of its positions" in flown.checked.finding
    assert max(flown.off_rad) < 0.01


def test_it_is_believed_again_once_the_two_agree():
    flown = Turning().fly(20.0, yaw_of=lambda truth, s: truth + 0.5 * (s < 5.0))
    assert flown.found_s is not None
    assert flown.checked.finding == ""


def test_single_headings_that_are_wrong_are_outliers():
    flown = Turning().fly(20.0, hdg_of=lambda truth, s: truth + (0.4 if round(s * 10) % 20 == 0 else 0.0))
    assert "yaw is" not in flown.checked.finding
    assert max(flown.off_rad) < 0.01


def test_headings_of_other_times_are_not_compared():
    checked = NoseCheck(TURN_MAX_RPS)
    for tick in range(50):
        attitude = Attitude(10.0 + tick * STEP_S, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        checked.take(attitude, 1.0, attitude.time_boot_s + 0.3)
    assert checked.finding == ""
