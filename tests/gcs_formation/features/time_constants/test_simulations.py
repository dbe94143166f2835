"""Simulations from setpoints alone, between samples that are apart by more than a step."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gcs_formation.features.time_constants.model_set import ModelSet, Samples
from tests.gcs_formation.features.time_constants.test_parts import (
    BELIEVED,
    FAST_S,
    HEADING_S,
    SLOW_S,
    SPEED_S,
    batches,
    flown_by,
    model,
)


@pytest.mark.parametrize("interval_s", [0.1, 0.4, 0.8])
def test_a_setpoint_acts_from_its_instant_on_however_rare_samples_are(interval_s: float) -> None:
    """Of the declared model: from 0.3 s on, in the first 0.8 s."""
    simulated, samples, found = ModelSet(model(), [[0.0]], [[0.0, 0.0]]), Samples(12), batches(1)
    simulated.initialise([False] * 3, 0, (22.0, 1.1, 100.0, 0.0))
    for number in range(round(0.8 / interval_s) + 1):
        samples.add(round(number * interval_s * 1e9), (20.0, 1.0, 90.0, 0.0))

    def mean(_: int, since: int, __: int) -> tuple[float, float, float]:
        return (22.5, 1.3, 102.0) if since >= 299_000_000 else (22.0, 1.1, 100.0)

    sent: Any = SimpleNamespace(acting=lambda _: 0, later=lambda index, _: index, mean=mean)
    assert simulated.fly(samples, sent, found) == [True] * 3
    off_mps, off_rad, off_m = (each.rows[each.count - 1][0] for each in found)
    left = (SLOW_S * math.exp(-0.5 / SLOW_S) - FAST_S * math.exp(-0.5 / FAST_S)) / (SLOW_S - FAST_S)
    assert off_mps == pytest.approx(22.5 - 0.5 * math.exp(-0.5 / SPEED_S) - 20.0)
    assert off_rad == pytest.approx(1.3 - 0.2 * math.exp(-0.5 / HEADING_S) - 1.0)
    assert off_m == pytest.approx(102.0 - 2.0 * left - 90.0)


@pytest.mark.parametrize(("interval_ms", "steps"), [(149, 1), (151, 2), (249, 2), (251, 3), (40, 1)])
def test_between_samples_steps_are_a_tenth_of_a_second_to_the_nearest_number(interval_ms: int, steps: int) -> None:
    simulated, samples, taken_ns = ModelSet(model(), [[0.0]], [[0.0, 0.0]]), Samples(4), list[int]()
    simulated.initialise([False] * 3, 0, (22.0, 1.1, 100.0, 0.0))
    for number in range(3):
        samples.add(number * interval_ms * 1_000_000, (22.0, 1.1, 100.0, 0.0))

    def mean(_: int, since: int, until: int) -> tuple[float, float, float]:
        taken_ns.append(until - since)
        return 22.0, 1.1, 100.0

    sent: Any = SimpleNamespace(acting=lambda _: 0, later=lambda index, _: index, mean=mean)
    simulated.fly(samples, sent, batches(1))
    assert taken_ns == pytest.approx([interval_ms * 1e6 / steps] * (2 * steps), abs=1.0)


@pytest.mark.parametrize(
    ("off_mps", "off_rad", "off_m"), [(0.0, 0.0, 0.0), (0.25, 0.0, 0.0), (0.0, 0.08, 0.0), (0.0, 0.0, 0.5)]
)
def test_each_channel_of_a_slow_vehicle_is_usable_within_its_own_rate_limit(
    off_mps: float, off_rad: float, off_m: float
) -> None:
    """Six tenths of 0.1 m/s², 0.08 rad/s and 0.2 m/s are free: 0.24 m/s, 0.072 rad, 0.48 m off at most."""
    slow = model()
    slow.accel_max_mps2, slow.turn_rate_max_rps, slow.climb_max_mps = 0.1, 0.08, 0.2
    simulated, samples = ModelSet(slow, [[0.0]], [[0.0, 0.0]]), Samples(4)
    simulated.initialise([False] * 3, 0, (22.0, 1.1, 100.0, 0.0))
    for number in range(3):
        samples.add(number * 100_000_000, (22.0, 1.1, 100.0, 0.0))
    setpoint = 22.0 + off_mps, 1.1 + off_rad, 100.0 + off_m
    sent: Any = SimpleNamespace(acting=lambda _: 0, later=lambda index, _: index, mean=lambda *_: setpoint)
    assert simulated.fly(samples, sent, batches(1)) == [not off_mps, not off_rad, not off_m]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_climb_that_begins_passes_its_limit_in_no_step_whatever_the_time_constants(sign: float) -> None:
    """Of half, once and twice the declared ones; 110 m ask for far more than 3 m/s."""
    before_m = [100.0] * 3
    for number in range(1, 11):
        _, (_, _, heights_m) = flown_by((22.0, 3.1, 100.0 + sign * 110.0), 0.1 * number)
        climbed_m = [sign * (height_m - each) for height_m, each in zip(heights_m, before_m, strict=True)]
        assert max(climbed_m) < 0.1 * BELIEVED.climb_max_mps + 1e-9
        assert min(climbed_m) > 0.0
        before_m = heights_m
    assert climbed_m == pytest.approx([0.1 * BELIEVED.climb_max_mps] * 3)
