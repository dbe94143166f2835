"""Vehicles that aren't heard: whether they still hear what they are told, nobody knows."""

from __future__ import annotations

import numpy as np

from airlink.clock import NANOSECONDS
from gcs_formation.arrays import Array, Instants, Mask
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Indices, Setpoints
from gcs_formation.estimation.predictor import SetpointHistory, advance
from gcs_formation.estimation.projection import Measured
from gcs_formation.link.connection import STALE_AFTER_S


class Silence:
    """Where vehicles are whose links are dead both ways: they fly on as they were told when they were last heard."""

    def __init__(self, history: SetpointHistory, model: AutopilotModel) -> None:
        """Take what was told from `history`; (C,) `model`."""
        self._history, self._model = history, model
        self._silent: Mask = np.zeros(model.tau_v_s.size, dtype=bool)
        self._held = Setpoints.of(np.full((3, self._silent.size), np.nan))

    def watch(self, measured: Measured, age_s: Array, uplink_ns: Instants) -> None:
        """Note who falls silent, and the last setpoint that may have reached it: `uplink_ns` after its state."""
        silent: Mask = age_s > STALE_AFTER_S
        (since,) = np.nonzero(silent & ~self._silent)
        self._silent = silent
        if since.size:
            self._held.fill(since, self._history.told(measured.stamps[since] + uplink_ns[since], since))

    def deaf(self, members: Indices) -> Indices:
        """Return which of some vehicles may be deaf, and were told something to fly on with."""
        return members[self._silent[members] & np.isfinite(self._held.heading_rad[members])]

    def states(self, deaf: Indices, measured: Measured, until: np.int64) -> FlightState:
        """Return where deaf vehicles are at `until`."""
        elapsed_s = np.maximum(until - measured.stamps[deaf], 0) / NANOSECONDS
        return advance(
            measured.state.take(deaf), self._held.take(deaf).table[None], elapsed_s[None], self._model.take(deaf)
        )
