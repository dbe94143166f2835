"""Figures of a flight that extensions bring: metrics from outside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from formation_scenario.expectation import Expectation
from formation_scenario.extensions import METRIC
from gcs_formation.control.outside import made
from gcs_formation.control.plain_values import vehicle_name
from gcs_formation.errors import RunAbortedError
from gcs_formation.extend.flight_window import FlightWindow
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record.flight import RecordedFlight


def measured(wanted: Expectation, scenario: Scenario, flight: RecordedFlight) -> float | None:
    """Return the figure of a metric from outside; None if it has none, or none that is finite.

    Raises:
        RunAbortedError: it raised an error.
    """
    entry = scenario.registered.get(wanted.metric, METRIC)
    assert entry is not None
    window = flight.window(wanted.from_s, wanted.to_s)
    each = {str(vehicle_name(who)): _Columns(own, window) for who, own in flight.vehicles.items()}
    seen = FlightWindow(flight.mission_time_s[window], 1.0 / scenario.law.rate_hz, flight.truth, each)
    metric = made(entry, scenario.extensions.get(entry.name, {}))

    def measured() -> float | None:
        value = metric.measure(seen)
        return None if value is None else figures.if_finite(float(value))

    return entry.call(measured, lambda why: RunAbortedError(f"the {entry} could not be computed: {why}"))


class _Columns(Mapping[str, Array]):
    """A vehicle's columns over a window of ticks; one that isn't asked for isn't copied."""

    def __init__(self, whole: Mapping[str, Array], window: Mask) -> None:
        self._whole, self._window = whole, window

    def __getitem__(self, name: str) -> Array:
        return self._whole[name][self._window]

    def __iter__(self) -> Iterator[str]:
        return iter(self._whole)

    def __len__(self) -> int:
        return len(self._whole)
