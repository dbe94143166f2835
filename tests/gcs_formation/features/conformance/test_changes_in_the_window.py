"""What is expected and flown within a window of eight states, by closed forms; states and setpoints are made up."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from tests.gcs_formation.features.conformance.test_checks import FIRST, Judged, said

SHARE = 1.0 - math.exp(-7 * 0.4 / 4.0)
"""Share of a step of airspeed that is expected between the first and the last state, whose time constant is 4 s."""


def test_changes_are_those_since_the_first_of_the_eight_states() -> None:
    """At the last of 14 checks, 0.02 m/s faster each, that is the seventh."""
    judged = Judged()
    for number in range(FIRST):
        found = judged.fly(1, 22.0 + 0.02 * number, to=(27.0, 0.0, 100.0))
    (failure,) = found
    assert failure.expected == pytest.approx((27.0 - 22.0 - 6 * 0.02) * SHARE, rel=1e-6)
    assert failure.flown == pytest.approx(7 * 0.02)


def test_of_a_change_of_airspeed_vertical_air_explains_nothing() -> None:
    """Of 1.1 m/s expected 0.25 m/s are flown: less than a quarter, though less than 1 m/s is missing."""
    judged = Judged()
    for number in range(FIRST):
        found = judged.fly(1, 22.0 + 0.25 / 7 * number, to=(24.4, 0.0, 100.0))
    (failure,) = found
    assert failure.channel == "airspeed"
    assert failure.expected - failure.flown < 0.9


def test_the_variance_of_the_air_decays_while_heights_are_as_expected() -> None:
    """By 0.4 s of 60 s each check, from 4.2 s on."""
    judged = Judged()
    judged.fly(10)
    judged.flier.air_variance = 9.0
    judged.fly(3)
    assert judged.flier.air_variance == pytest.approx(9.0 * (1.0 - 1.0 / 150.0) ** 3)


@pytest.mark.parametrize(("hovers", "channel"), [(False, "heading"), (True, "airspeed")])
def test_one_that_keeps_its_course_lacks_a_turn_and_a_multirotor_a_velocity(hovers: bool, channel: str) -> None:
    """Commanded the same speed to the east: a multirotor's velocity is to change by sqrt(2) of it."""
    judged = Judged(hovers=hovers)
    assert said(judged.fly(FIRST, to=(22.0, math.pi / 2.0, 100.0))) == [channel]


@pytest.mark.parametrize(("known", "channel"), [(0, "airspeed"), (1, "heading"), (2, "height")])
def test_one_that_acknowledges_setpoints_of_one_kind_is_judged_by_them_alone(known: int, channel: str) -> None:
    """It flies on, commanded 1.99 m/s more, half a radian, and a climb."""
    judged = Judged()
    judged.flier.vehicle.setpoint_channels = [
        SimpleNamespace(known_since=lambda *_, knows=number == known: knows) for number in range(3)
    ]
    assert said(judged.fly(FIRST, to=(23.99, 0.5, 180.0))) == [channel]


@pytest.mark.parametrize(("east_mps", "found"), [(4.168, []), (5.854, ["heading"])])
def test_gusts_from_the_side_explain_a_turn_of_one_radian_at_most(east_mps: float, found: list[str]) -> None:
    """A multirotor flies 1.5 m/s north; half of a change to the east makes it turn by 0.95 and by 1.1 rad."""
    judged = Judged(hovers=True)
    judged.flier.vehicle.setpoint_channels = [
        SimpleNamespace(known_since=lambda *_, on=on: on) for on in (False, True, False)
    ]
    judged.fly(10, mps=1.5)
    judged.flier.air_variance = 1.3
    assert said(judged.fly(FIRST - 10, mps=1.5, to=(math.hypot(1.5, east_mps), math.atan2(east_mps, 1.5), 100.0))) == []
    assert said(judged.fly(10, mps=1.5, to=(math.hypot(1.5, east_mps), math.atan2(east_mps, 1.5), 100.0))) == found


def test_one_that_hovers_in_still_air_as_commanded_obeys() -> None:
    assert Judged(hovers=True).fly(FIRST + 9, mps=0.0, to=(0.0, 0.0, 100.0)) == []
