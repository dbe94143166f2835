"""What one vehicle says that isn't compared: by a failed airspeed sensor, or before its attitude is known."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import after
from flight_model.slot import UNKNOWN
from gcs_formation.estimation.sample import Sample
from gcs_formation.features.telemetry_health.vehicle_health import Commanded
from tests.gcs_formation.features.telemetry_health.test_late_positions import NOISE
from tests.gcs_formation.features.telemetry_health.test_what_is_flown_and_said import START, Flight


def examined(flight: Flight, sample: Sample) -> Sample:
    nothing, now = Commanded(math.nan, UNKNOWN, stops=False), after(START, flight.at_s)
    return flight.health.examine(sample, NOISE, nothing, now, leads=False)


@pytest.mark.parametrize(("accepted", "flown_mps", "said"), [(True, 5.0, ["airspeed"]), (False, 35.0, [])])
def test_a_jump_is_taken_out_of_the_airspeed_of_a_sensor_that_is_accepted_only(
    accepted: bool, flown_mps: float, said: list[str]
) -> None:
    flight = Flight()
    flight.vehicle.sampler.airspeed_check = SimpleNamespace(accepted=accepted)
    flight.fly(40)
    sample: Any = flight.sample()
    sample.airspeed_mps = 35.0
    assert examined(flight, sample).airspeed_mps == pytest.approx(flown_mps)
    assert [quantity for quantity, _, _ in flight.said()] == said


def test_a_multirotors_sample_is_flown_itself_before_its_first_attitude() -> None:
    flight = Flight(hovers=True)
    for _ in range(5):
        sample = flight.sample()
        flight.vehicle.telemetry.attitude = None
        assert examined(flight, sample) is sample
    assert flight.said() == []
