"""An estimator of a link's delays from outside, in place of our own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from formation_scenario.extensions import Registered
from gcs_formation.control.outside import guarded, made
from gcs_formation.control.plain_values import RoundTrip, vehicle_name
from gcs_formation.errors import NotFiniteError


class OwnDelays:
    """The delays of one vehicle's link. After the estimator has failed they stay as they were."""

    failure: NotFiniteError | None = None
    """Why it failed."""

    def __init__(self, entry: Registered, keys: Mapping[str, Any], identity: VehicleId) -> None:
        """Make an instance for a vehicle.

        Raises:
            RunAbortedError: it can't begin.
        """
        self._entry, self._own = entry, made(entry, keys, vehicle=vehicle_name(identity))
        self.up_down_s = (math.nan, math.nan)
        """Delays up and down, s; NaN before the first answer."""

    def estimate(
        self, sent: Instant, vehicle_ns: int, now: Instant, loop_s: float, usual_s: tuple[float, float]
    ) -> tuple[float, float]:
        """Take an answered request, with our own delays up and down; return the estimator's, s."""
        if self.failure is None:
            times_s = sent / NANOSECONDS, now / NANOSECONDS, vehicle_ns / NANOSECONDS
            try:
                self.up_down_s = self._measured(RoundTrip(*times_s, loop_s, usual_s))
            except NotFiniteError as error:
                self.failure = error
        return usual_s if math.isnan(self.up_down_s[0]) else self.up_down_s

    def reset(self) -> None:
        """Forget what was accumulated."""
        if self.failure is None:
            try:
                guarded(self._entry, self._own.reset)
            except NotFiniteError as error:
                self.failure = error

    def _measured(self, trip: RoundTrip) -> tuple[float, float]:
        def up_down_s() -> tuple[float, float]:
            up_s, down_s = self._own.measure(trip)
            return float(up_s), float(down_s)

        up_s, down_s = guarded(self._entry, up_down_s)
        if not (0.0 <= up_s < math.inf and 0.0 <= down_s < math.inf):
            found = f"delays: {up_s:.6g} s up, {down_s:.6g} s down; allowed: 0 or more ({self._entry.where})"
            raise NotFiniteError(str(self._entry), None, found)
        return up_s, down_s
