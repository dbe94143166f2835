"""Updraughts, estimated from the Kalman filter's corrections of the climb."""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import AutopilotModel, squared
from flight_model.flight_state import FlightState

UPDRAUGHT_GAIN: Final = 2.0
"""Response of the height setpoint to fast changes of height that the model doesn't explain, in metres per metre.

Real autopilots follow fast setpoints further than (7) says: with a gain of 8, a PX4 whose time constants add up to 8 s
kept oscillating by 1 m.

Tuned: m/m; 1 to 4; shown by flights of PX4's simulator.
"""
UPDRAUGHT_SIGMAS: Final = 2.0
"""Updraughts within this many standard deviations of the telemetry's climb are taken for noise. Tuned: standard
deviations; 1.5 to 3; shown by `pytest tests/gcs_formation/estimation`."""
SWAY_MEMORY_S: Final = 60.0
"""Averaging time of `Updraught.sway_m2`; turbulence lasts for minutes, a gust for seconds. Tuned: s; 30 to 180; shown
by `pytest tests/gcs_formation/estimation`."""


class Updraught:
    """Vertical motion of the air at one vehicle, estimated from its climb beyond model (7)."""

    def __init__(self, *, followed: bool) -> None:
        """Start in still air. `followed`: whether the vehicle's state includes the updraught; else that stays 0."""
        self._followed = followed
        self._shown_mps = 0.0
        """The updraught that samples show; the state's follows it with a lag."""
        self._known_s = 0.0
        self.sway_m2 = 0.0
        """Mean square of the height error that updraughts cause at a constant height setpoint, m²."""

    def clear(self) -> None:
        """Reset the updraught with the vehicle's state, but keep `sway_m2`."""
        self._shown_mps = 0.0

    def update(
        self, state: FlightState, climbs_mps: float, variance: float, elapsed_s: float, model: AutopilotModel
    ) -> None:
        """Update the estimate by a sample, and the updraught of the sample's `state`.

        The vehicle's own climb follows its setpoints by (7). A climb beyond that lasts as long as the updraught; a
        passing difference decays with both time constants. Only the part above the telemetry's noise counts.

        Args:
            state: the corrected state; its updraught is changed.
            climbs_mps: correction of the climb that the model predicted with the present updraught.
            variance: of the telemetry's climb, (m/s)².
            elapsed_s: since the sample before.
            model: the vehicle's.
        """
        taus_s = model.tau_ha_s + model.tau_hb_s
        left = math.exp(-(1.0 / model.tau_ha_s + 1.0 / model.tau_hb_s) * elapsed_s)
        self._shown_mps += climbs_mps + (1.0 - left) * (state.updraught_mps - self._shown_mps)
        noise = squared(UPDRAUGHT_SIGMAS) * variance
        certain_mps = max(1.0 - noise / max(squared(self._shown_mps), noise), 0.0) * self._shown_mps
        self._known_s = min(self._known_s + elapsed_s, SWAY_MEMORY_S)
        if self._known_s > 0.0:
            self.sway_m2 += elapsed_s / self._known_s * (squared(taus_s * certain_mps) - self.sway_m2)
        if self._followed:
            share = 1.0 - math.exp(-UPDRAUGHT_GAIN * elapsed_s / taus_s)
            state.updraught_mps += share * (certain_mps - state.updraught_mps)
