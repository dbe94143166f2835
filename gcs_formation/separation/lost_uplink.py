"""Vehicles that may have lost the uplink: they answer nothing, so nobody knows whether they hear what they are told."""

from __future__ import annotations

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from gcs_formation.arrays import Instants, Mask
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Indices, Setpoints
from gcs_formation.estimation.predictor import SetpointHistory, advance
from gcs_formation.estimation.projection import Measured
from gcs_formation.vehicle.vehicle import UNANSWERED_S


class LostUplink:
    """Where vehicles are that hear nothing: they fly on as they were told when they last answered."""

    def __init__(self, history: SetpointHistory, model: AutopilotModel) -> None:
        """Take what was told from `history`; (C,) `model`."""
        self._history, self._model = history, model
        self._lost: Mask = np.zeros(model.tau_v_s.size, dtype=bool)
        self._held = Setpoints.of(np.full((3, self._lost.size), np.nan))

    def watch(self, now: Instant, heard: Instants) -> None:
        """Note whose uplink may be lost, and what each holds; (C,) `heard`: until when each is known to have heard."""
        lost: Mask = now - heard > UNANSWERED_S * NANOSECONDS
        (since,) = np.nonzero(lost & ~self._lost)
        self._lost = lost
        if since.size:
            self._held.fill(since, self._history.told(heard[since], since))

    def among(self, members: Indices) -> Indices:
        """Return those of some vehicles whose uplink may be lost."""
        return members[self._lost[members]]

    def states(self, which: Indices, measured: Measured, until: np.int64) -> FlightState:
        """Return where vehicles are at `until` that have heard nothing since."""
        elapsed_s = np.maximum(until - measured.stamps[which], 0) / NANOSECONDS
        told = self._held.take(which).table
        return advance(measured.state.take(which), told[None], elapsed_s[None], self._model.take(which))
