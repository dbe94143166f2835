"""What the leader was told lately: its followers follow what it flies by when their own setpoints act."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from airlink.clock import Instant
from gcs_formation.arrays import Array, Instants
from gcs_formation.estimation.flight_state import Setpoints
from gcs_formation.estimation.predictor import HISTORY_S


class Told(NamedTuple):
    """The leader's setpoints at some instants."""

    setpoints: Setpoints
    """(C,) columns."""
    turn_rps: Array
    """(C,) how fast the told heading turns, rad/s."""


class ToldLeader:
    """The leader's setpoints of the last seconds, tick by tick."""

    def __init__(self, dt_s: float) -> None:
        """Begin with none; `dt_s` is the time between ticks."""
        self._acts = deque[int](maxlen=max(2, int(HISTORY_S / dt_s)))
        self._rows = deque[tuple[float, float, float, float]](maxlen=self._acts.maxlen)

    def begin(self) -> None:
        """Forget everything: another vehicle leads."""
        self._acts.clear()
        self._rows.clear()

    def tell(self, acts: Instant, told: Setpoints, turn_rps: float) -> None:
        """Add a tick's setpoints (1,), when they act, and how fast their heading turns."""
        speed_mps, heading_rad, height_m = told.table[:, 0].tolist()
        if self._rows:
            before_rad = self._rows[-1][1]
            heading_rad = before_rad + math.remainder(heading_rad - before_rad, math.tau)
        self._acts.append(acts)
        self._rows.append((speed_mps, heading_rad, height_m, turn_rps))

    def at(self, instants: Instants) -> Told:
        """Return the means of what the leader flies by in the tick that begins at each instant, (C,).

        Its setpoints are held from tick to tick, so these means lie on straight lines between them. Before the oldest
        it is taken to fly by that one, after the newest by the newest.
        """
        acts = np.maximum.accumulate(np.array(self._acts))
        instants, acts = instants - acts[-1], acts - acts[-1]
        speed, heading, height, turn = (np.interp(instants, acts, row) for row in zip(*self._rows, strict=True))
        return Told(Setpoints(speed, heading, height), turn)
