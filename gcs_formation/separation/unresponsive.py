"""Vehicles that may not respond: they answer nothing, so that nobody knows whether they hear, or they don't obey."""

from __future__ import annotations

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from gcs_formation.arrays import Instants, Mask
from gcs_formation.estimation.flight_state import AutopilotModel, Indices, Setpoints
from gcs_formation.estimation.predictor import SetpointHistory, advance
from gcs_formation.estimation.projection import Measured
from gcs_formation.separation.manoeuvre import Traffic
from gcs_formation.vehicle.vehicle import UNANSWERED_S


class Unresponsive:
    """Predicts where such vehicles are if they really don't respond: they fly on as they did when they last did."""

    def __init__(self, history: SetpointHistory, model: AutopilotModel) -> None:
        """Take the setpoints that were sent from `history`; `model` has (C,) columns."""
        self._history, self._model = history, model
        count = model.tau_v_s.size
        self._unanswering: Mask = np.zeros(count, dtype=bool)
        self._disobeying: Mask = np.zeros(count, dtype=bool)
        self._held = Setpoints.of(np.full((3, count), np.nan))

    def watch(self, now: Instant, heard: Instants, disobeying: Mask) -> None:
        """Note who may not respond, and the setpoint that each of them holds.

        Args:
            now: the tick's instant.
            heard: (C,) until when each vehicle is known to have heard what it was told.
            disobeying: (C,) which don't seem to fly as they were told, though they hear it: they fly straight on.
        """
        before, self._unanswering = self._unanswering, now - heard > UNANSWERED_S * NANOSECONDS
        self._disobeying = disobeying
        (since,) = np.nonzero(self._unanswering & ~before)
        if since.size:
            self._held.fill(since, self._history.told(heard[since], since))

    def among(self, members: Indices) -> Indices:
        """Return those of some vehicles that may not respond."""
        return members[(self._unanswering | self._disobeying)[members]]

    def traffic(self, which: Indices, measured: Measured, at: np.int64) -> Traffic:
        """Return vehicles as they are at the instant `at` if they haven't responded since."""
        elapsed_s = np.maximum(at - measured.stamps[which], 0) / NANOSECONDS
        told, model = np.where(self._unanswering[which], self._held.take(which).table, np.nan), self._model.take(which)
        state = advance(measured.state.take(which), told[None], elapsed_s[None], model)
        return Traffic(state, np.zeros(which.size), np.zeros(which.size), model)
