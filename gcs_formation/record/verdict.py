"""The result of one expectation, and when it isn't judged."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from airlink.endpoint import VehicleId
from formation_scenario.expectation import JUDGED_SHARE, Expectation, bounds_text, keeps, stays_broken

WORDS = {True: "held", False: "broken", None: "not judged"}
ROUNDING_S = 1e-6


@dataclass(frozen=True)
class Verdict:
    """The result of one expectation for one vehicle, or for the run (None)."""

    expectation: Expectation
    vehicle: VehicleId | None
    value: float | None
    """Infinite for the separation of a single vehicle, which is null in summary.json."""
    reached: bool = True
    """Whether the window was flown to its end, and by this follower."""
    judged: bool = True
    """False if less than `JUDGED_SHARE` of the window was judged, and that didn't break the bound already."""
    reason: str = ""
    """Why the window wasn't reached or isn't judged, in words."""
    lost: bool = False
    """Whether this follower was lost, or its link silent, before the window's or the flight's end."""
    share: float = 1.0
    """Which part of the window was judged, from 0 to 1."""
    cut: bool = False
    """Whether `--until` or an order ended the flight before the window's end."""
    failed: bool = False
    """Whether the metric, one of an extension, raised an error, which is the `reason`."""

    @property
    def held(self) -> bool | None:
        """Whether the bound was kept over a window flown to its end; None if that isn't judged."""
        if not self.judged:
            return None
        if self.value is None or not self.reached:
            return False
        return keeps(self.value, self.expectation.below, self.expectation.above)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of summary.json."""
        wanted = self.expectation
        entry: dict[str, Any] = {"metric": wanted.metric}
        if self.vehicle is not None:
            entry["follower"] = self.vehicle.system if self.vehicle.network == 1 else str(self.vehicle)
        known = self.value is not None and math.isfinite(self.value)
        entry |= {"value": self.value if known else None, "from_s": wanted.from_s, "to_s": wanted.to_s}
        entry |= {name: bound for name in ("below", "above") if (bound := getattr(wanted, name)) is not None}
        entry |= {"held": self.held, "judged": self.judged, "judged_share": self.share, "reached": self.reached}
        return entry | ({"reason": self.reason} if self.reason else {})

    def __str__(self) -> str:
        wanted = self.expectation
        who = f"vehicle {self.vehicle}: " if self.vehicle else ""
        found = "no value" if self.value is None else f"{self.value:.4g}"
        state = WORDS[self.held] + (f": {self.reason}" if self.reason else "")
        window = f"from {wanted.from_s:g} s to {wanted.to_s:g} s"
        expected = bounds_text(wanted.below, wanted.above)
        return f"{who}{wanted.metric} {window}: found {found}; expected: {expected}: {state}"


def weighed(verdict: Verdict) -> Verdict:
    """Return a verdict with its figure that isn't judged if too little of its window was, and that breaks no bound."""
    wanted, value = verdict.expectation, verdict.value
    if verdict.share >= JUDGED_SHARE - ROUNDING_S or not (verdict.reached or verdict.cut):
        return verdict
    if verdict.cut:
        broken = stays_broken(wanted.metric, value, wanted.below, wanted.above, verdict.share)
    else:
        broken = value is not None and not keeps(value, wanted.below, wanted.above)
    return replace(verdict, judged=broken)
