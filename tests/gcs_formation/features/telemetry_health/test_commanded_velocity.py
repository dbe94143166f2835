"""The velocity that a multirotor should have by what it was commanded, whatever its messages say."""

from __future__ import annotations

import math

import pytest

from flight_model.autopilot_model import AutopilotModel
from gcs_formation.features.telemetry_health.commanded_velocity import GAP_S, CommandedVelocity

TAU_S = 0.8
MODEL = AutopilotModel(TAU_S, 0.6, 0.3, 0.3, 0.0, 15.0, 20.0, 0.5, 1.5)
"""Its acceleration's limit is far away."""
EAST = (8.0, math.pi / 2, 30.0)
NOTHING = (math.nan, math.nan, 30.0)


def taken(times_s, commanded, reported=(3.0, 4.0), stops=False):
    """Return the velocity at each time."""
    follows = CommandedVelocity(MODEL)
    return [follows.take(1 + round(at_s * 1e9), commanded, reported, stops=stops) for at_s in times_s]


def test_it_begins_as_reported_and_follows_the_command_with_the_time_constant():
    begun, later = taken((0.0, TAU_S), EAST)
    assert begun == pytest.approx([3.0, 4.0])
    assert later == pytest.approx([3.0 / math.e, 8.0 - 4.0 / math.e])


@pytest.mark.parametrize("commanded", [EAST, NOTHING])
def test_one_that_is_commanded_to_stop_stops_whatever_its_last_setpoint_was(commanded):
    assert taken((0.0, TAU_S), commanded, stops=True)[1] == pytest.approx([3.0 / math.e, 4.0 / math.e])


def test_without_a_command_it_is_unknown_and_then_begins_as_reported():
    follows = CommandedVelocity(MODEL)
    follows.take(1, EAST, (3.0, 4.0), stops=False)
    assert all(map(math.isnan, follows.take(100_000_001, NOTHING, (3.0, 4.0), stops=False)))
    assert follows.take(200_000_001, EAST, (1.0, -2.0), stops=False) == pytest.approx([1.0, -2.0])


def test_after_a_gap_it_begins_as_reported_and_a_sample_twice_moves_nothing():
    assert taken((0.0, GAP_S + 0.1), EAST)[1] == pytest.approx([3.0, 4.0])
    once, twice = taken((0.0, 0.5, 0.5), EAST)[1:]
    assert once == twice != pytest.approx([3.0, 4.0], abs=1.0)
