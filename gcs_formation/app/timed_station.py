"""A station that times its control ticks."""

from __future__ import annotations

import numpy as np
from librt.strings import BytesWriter, write_f64_le

from airlink.clock import NANOSECONDS, Instant, Stopwatch
from airlink.signing.signed_links import SignedLinks
from flight_model.arrays import Array
from formation_scenario import Scenario
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.record.run_directory import RunDirectory
from gcs_formation.station import Station


class TimedStation(Station):
    """A station that times its control ticks."""

    def __init__(
        self,
        scenario: Scenario,
        recorder: RunDirectory,
        until_s: float | None,
        utc_at_0_s: float | None,
        caution: PreFlightOptions,
        resumed: PastFlight | None,
        signing: SignedLinks | None,
    ) -> None:
        super().__init__(scenario, recorder, until_s, utc_at_0_s, caution, resumed, signing)
        self._watch = Stopwatch()
        self._times = BytesWriter()
        """Three 64-bit floats for each tick: when it was due and when it began, ns, and how long it took, s."""

    def handle_timer(self, now: Instant) -> None:
        """Do what is due; record the times of a tick that commanded the formation."""
        due, ticks = self.next_timer(), self.controlled_ticks
        began_s = self._watch.wall_s
        super().handle_timer(now)
        if due is not None and self.controlled_ticks > ticks:
            write_f64_le(self._times, float(due))
            write_f64_le(self._times, float(now))
            write_f64_le(self._times, self._watch.wall_s - began_s)

    def times_s(self) -> Array:
        """Return (3, K), s: when each tick was due, when it began, and how long it took."""
        due_ns, begun_ns, taken_s = np.frombuffer(self._times.getvalue(), "<f8").reshape(-1, 3).T
        return np.array((due_ns / NANOSECONDS, begun_ns / NANOSECONDS, taken_s))
