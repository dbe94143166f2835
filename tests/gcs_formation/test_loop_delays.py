"""The age of the newest periodic message over lossy links."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from formation_scenario.links import Impairment
from gcs_formation.app.loop_delays import message_age


def test_without_loss_an_age_is_uniform_within_a_period() -> None:
    assert message_age(Impairment()) == pytest.approx((1 / 2, 1 / 12))


def test_independent_losses_make_the_mean_age_so_much_longer() -> None:
    """A geometric number of periods, each arriving with the probability q: var = (q^2 - 12 q + 12)/(12 q^2)."""
    q = 0.85
    assert message_age(Impairment(loss=1.0 - q)) == pytest.approx((1.15 / 1.7, (q**2 - 12 * q + 12) / (12 * q**2)))


def test_losses_in_bursts_are_as_a_simulated_channel_has_them() -> None:
    random, lost, burst = np.random.default_rng(1), 0.2, 4.0
    begins, ends = lost / (burst * (1.0 - lost)), 1.0 / burst
    bad, since, ages = False, 0.0, list[float]()
    for chance, when in random.random((200_000, 2)).tolist():
        bad = chance >= ends if bad else chance < begins
        since = since + 1.0 if bad else 0.0
        ages.append(since + when)
    found = message_age(Impairment(loss=lost, mean_burst=burst))
    assert found == pytest.approx((np.mean(ages), np.var(ages)), rel=0.03)


@pytest.mark.parametrize("keys", [{"loss": 1.0}, {"outage": True}])
def test_what_never_arrives_is_infinitely_old(keys: dict[str, Any]) -> None:
    assert message_age(Impairment(**keys))[0] == math.inf
