"""Fits of one channel to batches whose simulations differ by a known polynomial of the logarithm of a ratio."""

from __future__ import annotations

import math

import pytest

from gcs_formation.features.time_constants.fit import TimeConstantFit
from gcs_formation.features.time_constants.interpolation import Nodes
from gcs_formation.features.time_constants.model_set import ResidualBatch

RESOLUTION, FINEST, HZ = 0.02, 0.001, 10.0


class Channel:
    """A channel of one time constant that is `log_ratio` off the declared one."""

    def __init__(self, log_ratio: float, *, in_use: bool = True) -> None:
        self.nodes, self.log_ratio = Nodes(5, 1), log_ratio
        self.fit = TimeConstantFit(self.nodes, RESOLUTION, FINEST, HZ, in_use=in_use)

    def update(self, amplitude: float, noise: float = 0.0) -> bool:
        """Take eight samples, in which simulations are off by this for each unit of the logarithm, to either side.

        Noise, likewise, has no part in common with that.
        """
        batch = ResidualBatch(5, 8)
        for number in range(8):
            row = batch.next()
            for index, (at,) in enumerate(self.nodes.at):
                off = amplitude * (-1) ** (number // 2) * (at - self.log_ratio)
                row[index] = off + noise * (-1) ** number
        return self.fit.update(batch)


@pytest.mark.parametrize("log_ratio", [0.45, -0.45])
def test_fits_go_on_in_calm_flight_by_a_tenth_at_most_until_they_change_less_than_a_thousandth(
    log_ratio: float,
) -> None:
    """A sixth fit, at 0.45, changes nothing more; what was found stays."""
    channel, changes, goes_on = Channel(log_ratio), list[float](), True
    while goes_on:
        before = channel.fit.log_ratio[0]
        goes_on = channel.update(0.0 if changes else 2.0)
        changes.append(channel.fit.log_ratio[0] - before)
    sign = math.copysign(1.0, log_ratio)
    assert changes == pytest.approx([sign * each for each in (0.1, 0.1, 0.1, 0.1, 0.05, 0.0, 0.0)], abs=2e-4)
    assert changes[-1] == 0.0
    assert channel.fit.log_ratio[0] == pytest.approx(log_ratio, abs=1e-3)


def test_what_has_changed_is_followed_in_as_many_samples_as_show_it_to_two_percent() -> None:
    """8 samples of 0.147² over 1.38 * 10 * 0.01² have the information 125: of 20 batches it is 1 / 0.02².

    Half of a small change is followed in ln 2 of these 20, and later by what the change itself seems to scatter.
    """
    channel = Channel(0.2)
    for _ in range(200):
        channel.update(0.147, noise=0.01)
    assert channel.fit.log_ratio[0] == pytest.approx(0.2, abs=0.002)
    channel.log_ratio, batches = 0.23, 0
    while channel.fit.log_ratio[0] < 0.215:
        channel.update(0.147, noise=0.01)
        batches += 1
    assert 20 * math.log(2.0) - 1.0 < batches < 20.0


@pytest.mark.parametrize("bias", [0.05, -0.05])
def test_a_constant_bias_of_a_sensor_is_no_mismatch_in_motion_and_in_calm_flight(bias: float) -> None:
    """Half of the time all simulations are off the same way, by more than the bias."""
    channel, found = Channel(0.0, in_use=False), list[float]()
    for number in range(160):
        batch, amplitude = ResidualBatch(5, 8), 0.2 if number % 20 < 10 else 0.0
        for _ in range(8):
            row = batch.next()
            for index, (at,) in enumerate(channel.nodes.at):
                row[index] = bias + amplitude * at
        channel.fit.update(batch)
        found.append(channel.fit.mismatch)
    assert found == [0.0] * 160
    assert channel.fit.log_ratio == pytest.approx([0.0], abs=1e-6)
