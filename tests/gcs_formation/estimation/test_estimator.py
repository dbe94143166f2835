"""The states that the station keeps of its vehicles."""

from __future__ import annotations

import math

import numpy as np

from airlink.clock import Instant, after
from formation_scenario import load_scenario
from gcs_formation.controller import FormationController
from gcs_formation.estimation.estimator import Sample
from gcs_formation.estimation.flight_state import Setpoints
from gcs_formation.estimation.predictor import SentSetpoints
from tests.flights.conftest import scenario

SPEED, HEADING = 22.0, 0.4


def flown(source: str, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fly straight on for a while; return errors of the samples and of the states, (K, 4), and the declared sigmas."""
    planned = load_scenario(scenario(vehicles={"count": 3, "navigation": {"source": source}}))
    controller = FormationController(planned)
    estimator, told = controller.estimator, (np.full(3, value) for value in (SPEED, HEADING, 100.0))
    controller.history.add(SentSetpoints(np.zeros(3, dtype=np.int64), Setpoints(*told)))
    sigmas, random = np.array((0.3, 0.3, 0.3, 0.2)), np.random.default_rng(1)
    raw, kept = list[np.ndarray](), list[np.ndarray]()
    for tenth in range(round(10 * seconds)):
        at_s, noise = 0.1 * tenth, sigmas * random.standard_normal(4)
        north, east = SPEED * at_s * math.cos(HEADING), SPEED * at_s * math.sin(HEADING)
        over_ground = SPEED * math.cos(HEADING), SPEED * math.sin(HEADING), 0.0
        true = np.array((north, east, 100.0, SPEED))
        seen = true + noise
        estimator.update(1, Sample(after(Instant(0), at_s), *seen[:3], *over_ground, HEADING, seen[3]))
        state = estimator.state
        found = np.array([float(row[1]) for row in (state.north_m, state.east_m, state.height_m, state.airspeed_mps)])
        raw.append(noise)
        kept.append(found - true)
    return np.array(raw), np.array(kept), sigmas


def test_what_noisy_vehicles_tell_is_filtered_and_what_others_tell_is_taken_as_it_is() -> None:
    _, kept, sigmas = flown("noisy", 30.0)
    assert np.all(np.sqrt((kept[100:] ** 2).mean(axis=0)) < 0.6 * sigmas)
    raw, exact, _ = flown("truth", 3.0)
    np.testing.assert_allclose(exact, raw, atol=1e-9)
