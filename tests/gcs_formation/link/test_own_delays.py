"""An estimator of delays from outside: what it says is used, and checked, and stays once it has failed."""

from __future__ import annotations

import math

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from formation_scenario.extensions import Origin, Registered
from gcs_formation.control.plain_values import RoundTrip
from gcs_formation.extend.station_parts import DelayEstimator
from gcs_formation.link.own_delays import OwnDelays

USUAL_S = (0.3, 0.2)


class Replies(DelayEstimator):
    """Says what it is given, one after the other."""

    def __init__(self, keys: object) -> None:
        self.replies, self.trips, self.resets = list[tuple[float, float]](), list[RoundTrip](), 0

    def measure(self, trip: RoundTrip) -> tuple[float, float]:
        self.trips.append(trip)
        return self.replies.pop(0)

    def reset(self) -> None:
        self.resets += 1


def estimator(*replies: tuple[float, float]) -> tuple[OwnDelays, Replies]:
    own = OwnDelays(Registered("delay estimator", "it", Replies, 1, Origin("it.py", "")), {}, VehicleId(0, 3))
    inner = own._own
    inner.replies = list(replies)
    return own, inner


def estimate(own: OwnDelays) -> tuple[float, float]:
    return own.estimate(after(Instant(0), 10.0), 500_250_000_000, after(Instant(0), 10.5), 0.02, USUAL_S)


def test_it_gets_the_round_trip_in_seconds_and_its_delays_are_used() -> None:
    own, inner = estimator((0.4, 0.1), (0.0, 0.5))
    assert estimate(own) == (0.4, 0.1)
    assert inner.trips == [RoundTrip(10.0, 10.5, 500.25, 0.02, USUAL_S)]
    assert estimate(own) == own.up_down_s == (0.0, 0.5)
    assert own.failure is None


@pytest.mark.parametrize("wrong", [(-0.1, 0.1), (0.1, -0.1), (math.nan, 0.1), (0.1, math.inf), (math.inf, 0.1)])
def test_delays_that_none_can_be_are_refused_and_the_last_ones_stay(wrong: tuple[float, float]) -> None:
    own, inner = estimator((0.4, 0.1), wrong, (0.2, 0.2))
    assert [estimate(own) for _ in range(3)] == [(0.4, 0.1)] * 3
    assert own.failure is not None
    assert "allowed: 0 or more" in str(own.failure)
    own.reset()
    assert (len(inner.trips), inner.resets) == (2, 0), "it isn't called again"


def test_one_that_fails_at_once_leaves_our_own_delays() -> None:
    own, _ = estimator()
    assert estimate(own) == USUAL_S
    assert "IndexError" in str(own.failure)
