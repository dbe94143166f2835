"""The state of every vehicle at its newest time stamp, on our clock: predicted, then corrected by its filter."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, Instant, seconds_between
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.estimation.noise_and_plausibility import (
    PositionDrift,
    VehicleNoise,
)
from gcs_formation.estimation.sample import Sample
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.estimation.vehicle_filter import VehicleFilter, min_mps

FORGOTTEN_S: Final = 5.0
"""The filter restarts from a sample if its state is older than this. Tuned: s; 2 to 10; shown by `pytest
tests/gcs_formation/estimation`."""


class StateEstimator:
    """The filters of C vehicles."""

    def __init__(
        self,
        noise: list[VehicleNoise],
        history: SetpointHistory,
        telemetry_hz: float,
        wind_radps: float,
        *,
        updraughts: bool = True,
    ) -> None:
        """Start with nothing known.

        Args:
            noise: of the vehicles' telemetry, (C,).
            history: the setpoints that were sent to them.
            telemetry_hz: samples a second.
            wind_radps: highest bandwidth of the wind estimate for anything but gusts; 0: the wind stays 0.
            updraughts: whether vertical motion of the air is estimated; else it stays 0.
        """
        self.filters = [VehicleFilter(each, wind_radps, telemetry_hz, updraughts=updraughts) for each in noise]
        """One for each vehicle, with its newest state."""
        self._history = history

    def observe_wind(self, wind_radps: float) -> None:
        """Set the highest bandwidth of the wind estimate."""
        for each in self.filters:
            each.wind_radps = wind_radps

    @property
    def sway_m(self) -> float:
        """Standard deviation of the height error from vertical gusts, of the vehicle with the largest, m."""
        return math.sqrt(max([each.updraught.sway_m2 for each in self.filters]))

    def age_s(self, index: int, now: Instant) -> float:
        """Return how old a vehicle's state is, in s; NaN when it has none."""
        each = self.filters[index]
        return math.nan if each.state is None else seconds_between(Instant(each.stamp), now)

    def restart_filter(self, index: int) -> None:
        """Reset the filter of a vehicle that has restarted."""
        self.filters[index].state = None
        self.filters[index].noise.initialise()
        self.filters[index].drift = PositionDrift()

    def update_states(self, samples: list[Sample | None], models: list[AutopilotModel], commanded: list[bool]) -> None:
        """Take the newest samples, None where there is none; `commanded`: who follows our setpoints; (C,) each.

        All states are predicted, then all corrected: the code of both steps exceeds the processor's first cache.
        """
        predicted = [
            None if sample is None else self._predict(index, sample, models[index])
            for index, sample in enumerate(samples)
        ]
        for index, state in enumerate(predicted):
            sample = samples[index]
            if state is not None and sample is not None:
                each, model = self.filters[index], models[index]
                stamp, values = max(int(sample.stamp), each.stamp), sample.values(min_mps(model))
                each.correct(values, stamp, state, model, commanded=commanded[index])

    def _predict(self, index: int, sample: Sample, model: AutopilotModel) -> FlightState | None:
        """Return a vehicle's state predicted for its newest sample; None if the filter starts from that sample."""
        each, stamp = self.filters[index], int(sample.stamp)
        each.use_airspeed_ratio(sample.airspeed_ratio)
        state = each.state
        if state is None or self._history.empty or (stamp - each.stamp) / NANOSECONDS > FORGOTTEN_S:
            each.initialise(sample.values(min_mps(model)), stamp)
            return None
        predicted = state.copy()
        self._history.carry(predicted, each.stamp, max(stamp, each.stamp), index, model)
        return predicted
