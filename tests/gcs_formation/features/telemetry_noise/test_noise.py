"""Events about noise that isn't as declared."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.estimation.noise_and_plausibility import VehicleNoise
from gcs_formation.features.telemetry_noise.noise import TelemetryNoise
from tests.gcs_formation.event_log import EventLog

DECLARED = np.array([0.3, 0.3, 0.1, 0.1, 0.2, 0.01])[:, None]
WHO = VehicleId(1, 2)


def said(times, samples=400, stated=True):
    """Return the events while the position's noise is `times` the declared one, and as declared afterwards."""
    noise = VehicleNoise(tuple(DECLARED[:, 0]), tuple(DECLARED[:, 0] / 4), stated=stated)
    random, logged = np.random.default_rng(1), EventLog()
    vehicles: Any = {WHO: SimpleNamespace(identity=WHO, index=0)}
    cycle: Any = SimpleNamespace(vehicles=vehicles, log_event=logged)
    watch = TelemetryNoise(cycle)
    sigma = np.repeat(DECLARED, (2, 1, 2, 1, 1, 1), axis=0)
    for scale in (times, 1.0):
        before = np.zeros((8, 1))
        for _ in range(samples):
            white = sigma * random.standard_normal((8, 1))
            white[:2] *= scale
            spread = 2.0 * (sigma * scale) ** 2
            noise.adapt(tuple((white - before)[:, 0].tolist()), tuple(spread[:, 0].tolist()))
            before = white
            watch.watch_noise(Instant(0), [noise])
    return logged.of("noise")


def test_noise_that_is_three_times_as_declared_is_said_once_and_when_it_is_over():
    first, *_, last = said(3.0)
    assert first.startswith("position is ")
    assert last == "is as noisy as declared again"


def test_noise_as_declared_and_noise_of_which_nothing_is_declared_are_nothing_to_tell():
    assert said(1.0) == []
    assert said(3.0, stated=False) == []
