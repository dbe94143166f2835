"""Air that rises or sinks: what carries a vehicle up besides its own climb, and by how much that moves its height."""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot import AutopilotModel, FlightState, squared

UPDRAUGHT_GAIN: Final = 2.0
"""How many metres a height setpoint answers each metre of height, in a fast swing, that the model doesn't explain.

Real autopilots follow fast setpoints farther than (7) says: a PX4 whose lags add up to 8 s kept swinging by 1 m at 8.
"""
UPDRAUGHT_SIGMAS: Final = 2.0
"""Standard deviations of a sample's climb below which it may be noise."""
SWAY_MEMORY_S: Final = 60.0
"""For how long it is remembered how far a vehicle was moved; turbulence lasts for minutes, a gust for seconds."""


class Updraught:
    """What carries one vehicle up, from how it climbs against model (7)."""

    __slots__ = ("_felt_mps", "_followed", "_known_s", "sway_m2")

    def __init__(self, *, followed: bool) -> None:
        """Start in still air. `followed`: whether states have it."""
        self._followed = followed
        self._felt_mps = 0.0
        """As samples show it; of a state it is as far as that is followed."""
        self._known_s = 0.0
        self.sway_m2 = 0.0
        """Mean square of how far it moves a vehicle that is told a height."""

    def forget(self) -> None:
        """Begin anew with a vehicle's state; the air is as rough as it was."""
        self._felt_mps = 0.0

    def feel(
        self, state: FlightState, climbs_mps: float, variance: float, elapsed_s: float, model: AutopilotModel
    ) -> None:
        """Take what a sample says; the updraught that the sample's `state` has follows.

        Its own climb follows its setpoints by (7): what it climbs faster than that, it keeps as long as the air carries
        it, and a difference that doesn't last ends by both lags. It counts as far as it stands out from noise.

        Args:
            state: by model and sample; its updraught is changed.
            climbs_mps: by how much it climbs faster than the model has it in its updraught.
            variance: of the telemetry's climb, (m/s)².
            elapsed_s: since the sample before.
            model: the vehicle's.
        """
        lags_s = model.tau_ha_s + model.tau_hb_s
        left = math.exp(-(1.0 / model.tau_ha_s + 1.0 / model.tau_hb_s) * elapsed_s)
        self._felt_mps += climbs_mps + (1.0 - left) * (state.updraught_mps - self._felt_mps)
        noise = squared(UPDRAUGHT_SIGMAS) * variance
        certain_mps = max(1.0 - noise / max(squared(self._felt_mps), noise), 0.0) * self._felt_mps
        self._known_s = min(self._known_s + elapsed_s, SWAY_MEMORY_S)
        if self._known_s > 0.0:
            self.sway_m2 += elapsed_s / self._known_s * (squared(lags_s * certain_mps) - self.sway_m2)
        if self._followed:
            share = 1.0 - math.exp(-UPDRAUGHT_GAIN * elapsed_s / lags_s)
            state.updraught_mps += share * (certain_mps - state.updraught_mps)
