# Compiled by mypyc: it runs every tick.

"""What an autopilot says of its own estimates: ArduPilot's EKF_STATUS_REPORT and lane switches, PX4's ESTIMATOR_STATUS.

Both report which estimates are valid, and innovations as shares of their gates: from 1 on a measurement isn't fused. It
is the only witness of a position and a velocity that drift together, as in dead reckoning. (ArduPilot's developer
documentation, "EKF failsafe"; PX4's user guide, "Using the ECL EKF": `estimator_status`.)
"""

from __future__ import annotations

from typing import Final

from airlink import mavlink as m
from airlink.clock import LONG_AGO, Instant, seconds_between
from gcs_formation.vehicle.telemetry import Telemetry

GATE: Final = 1.0
IN_A_ROW: Final = 2
"""So many reports in a row of innovations beyond their gates are no outlier."""
SWITCHES_S: Final = 5.0
"""What jumps so soon after a switch of lanes was said has jumped by it, s."""
QUANTITIES: Final = ("velocity", "position", "height")
"""Of the ratios, in their order."""
ABSOLUTE: Final = m.EKF_POS_HORIZ_ABS
CONSTANT: Final = m.EKF_CONST_POS_MODE
"""Both autopilots' flags have these bits."""
LANES: Final = ("lane switch", "primary changed")
"""In texts of ArduPilot: "EKF3 lane switch 1", "EKF primary changed:1"."""


class EstimatorReport:
    """What one vehicle has said."""

    def __init__(self) -> None:
        """Start with nothing said."""
        self.lost = False
        """Whether it knows no absolute position any more."""
        self.switched = ""
        """Its words about its last switch of lanes, while what jumps may be due to that."""
        self._had, self._reports, self._texts = False, 0, 0
        self._beyond = [0, 0, 0]
        self._ratios = (0.0, 0.0, 0.0)
        self._switched_at = LONG_AGO

    def take(self, seen: Telemetry, now: Instant) -> None:
        """Take what is new."""
        if seen.estimator_reports != self._reports:
            self._reports, self._ratios = seen.estimator_reports, seen.estimator_ratios
            absolute = bool(seen.ekf_flags & ABSOLUTE) and not seen.ekf_flags & CONSTANT
            self._had = self._had or absolute
            self.lost = self._had and not absolute
            for index, ratio in enumerate(self._ratios):
                self._beyond[index] = self._beyond[index] + 1 if ratio >= GATE else 0
        if seen.texts_reported != self._texts:
            self._texts = seen.texts_reported
            text = seen.texts[-1]
            for words in LANES:
                if words in text:
                    self.switched, self._switched_at = text, now
        if self.switched and seconds_between(self._switched_at, now) > SWITCHES_S:
            self.switched = ""

    def findings(self) -> dict[str, str]:
        """Return the quantities that it doubts, with its evidence."""
        found = dict[str, str]()
        for index, quantity in enumerate(QUANTITIES):
            if self._beyond[index] >= IN_A_ROW:
                times = f"{self._ratios[index]:.1f} times their gate"
                found[quantity] = f"its estimator rejects measurements of its {quantity}: {times}"
        if self.lost:
            found["position"] = "its estimator has no absolute position any more: not flown by"
        return found
