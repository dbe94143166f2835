"""The figures of a vehicle's link, and verdicts on them: not judged, or broken, where it was silent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flight_model.arrays import Array
from formation_scenario import Scenario, Vehicle
from formation_scenario.expectation import WINDOWED
from formation_scenario.links import LinkStep
from gcs_formation.record.verdict import Verdict, weighed

UNANSWERED_S = 10.0
"""A longer time without answers at a window's end is a time without measured delays."""


@dataclass(frozen=True)
class LinkFigures:
    """Counts and delays (s) of one vehicle's link."""

    delays_s: Array
    """(P, 3) delays of each answered request: half the round trip, up, down; NaN while the split is unknown."""
    delay_times_s: Array
    """Mission times of the requests, NaN before the path began."""
    measured_loss: float
    frames_in: int
    frames_out: int
    frames_bad: int
    frames_implausible: int = 0
    frames_duplicate: int = 0
    frames_late: int = 0
    authenticated: bool = False
    """Whether every frame that was taken as the vehicle's was signed with its link's key."""
    frames_unverified: int = 0
    """Frames that were signed where there is no key, or taken unsigned where there is one."""
    refused: Mapping[str, int] = field(default_factory=dict[str, int])
    """Frames that were refused by their signature, by cause."""
    injected: tuple[float, float, float, float] | None = None
    """Realised mean delays up and down, s, and shares of the datagrams lost up and down.

    None if the link's impairments are unknown, as in `fly` behind something else.
    """
    due_to_s: float = math.inf
    """Mission time at which a planned fault silenced the vehicle for the rest of the flight; infinite if none did."""
    heard_to_s: float = math.inf
    """Mission time of its last frame if it was silent at the flight's end; infinite if it wasn't."""
    radio: Mapping[str, Any] | None = None
    """What the radio by which it is reached reported (`record.radio`); None without reports."""
    probed_ns: Array = field(default_factory=lambda: np.empty(0))
    """(P,) when each request was answered, ns."""
    each: tuple[Any, ...] = ()
    """Each of its links (`record.several_links.OneLink`) if it has several; the figures above are of the one in use."""

    def answered_to_s(self, end_s: float) -> float:
        """Return the mission time of the last answered request before `end_s`; infinite if that isn't long before."""
        last_s = float(np.max(self.delay_times_s, where=self.delay_times_s <= end_s, initial=-math.inf))
        return last_s if end_s - last_s > UNANSWERED_S else math.inf

    @property
    def one_way_s(self) -> Array:
        """(P,) the one-way delays, at least 0: the mean wait for the autopilot's loop may exceed the measured delay."""
        return np.maximum(self.delays_s[:, 0], 0.0)


def is_out(scenario: Scenario, vehicle: Vehicle, at_s: float, *, either: bool = False) -> bool:
    """Return whether by the scenario nothing comes down any of a vehicle's links, or passes in `either` direction."""
    numbers = range(1, 1 + len(vehicle.endpoints))
    return all(_is_out(scenario.link_steps(vehicle, number), at_s, either=either) for number in numbers)


def _is_out(steps: Sequence[LinkStep], at_s: float, *, either: bool) -> bool:
    step = ([each for each in steps if each.at_s <= at_s] or steps[:1])[-1]  # at_s is NaN before the path
    directions = (step.downlink, step.uplink) if either else (step.downlink,)
    return any(each.outage or each.loss == 1.0 or step.at_s + each.delay_ms / 1e3 > at_s for each in directions)


def link_verdict(verdict: Verdict, link: LinkFigures, end_s: float, *, out: bool) -> Verdict:
    """Return the verdict on a link, changed if its vehicle fell silent for good before `end_s`.

    If the scenario silenced it, the link isn't judged, unless it had broken a bound before. If it fell silent by
    itself, a metric over a window is broken, as nothing was measured; one of the whole flight stands, because it counts
    the silence. A vehicle that doesn't receive is silent as to delays: it answers no request.

    Args:
        verdict: by the figures alone.
        link: when the vehicle was silenced by a fault, and when it was last received and last answered.
        end_s: the end of the window, or of the flight if that came first.
        out: whether the scenario has an outage of the link then.
    """
    windowed, fault = verdict.expectation.metric in WINDOWED, link.due_to_s < end_s
    needs_answers = verdict.expectation.metric.startswith("measured_delay")
    silent_s = min(link.due_to_s, link.heard_to_s, link.answered_to_s(end_s) if needs_answers else math.inf)
    if verdict.held is None or silent_s >= end_s:
        return verdict
    state = "silenced" if min(link.due_to_s, link.heard_to_s) < end_s else "cut off"
    if fault or (out and windowed):
        at_s, whose = (link.due_to_s, "faults") if fault else (silent_s, "links")
        reason = f"{state} at {at_s:.1f} s by the scenario's {whose}"
        known = verdict.value is not None and verdict.held is False
        reason = f"before it was {reason}" if known else reason
        return replace(verdict, reached=False, judged=known, reason=reason, lost=True)
    why = "not heard" if state == "silenced" else "no answer"
    reached, reason = verdict.reached and not windowed, f"{why} from {silent_s:.1f} s on"
    return replace(verdict, reached=reached, reason=reason, lost=windowed)


def as_answered(verdict: Verdict, link: LinkFigures) -> Verdict:
    """Return a verdict on measured delays that isn't judged if too much of its window passed without answers."""
    wanted = verdict.expectation
    if not wanted.metric.startswith("measured_delay") or verdict.held is None or verdict.lost or not verdict.reached:
        return verdict
    times_s = np.sort(link.delay_times_s)
    times_s = times_s[(times_s >= wanted.from_s) & (times_s <= wanted.to_s)]
    edges_s = np.concatenate(([wanted.from_s], times_s, [wanted.to_s]))
    intervals_s = np.diff(edges_s)
    silent_s = float(intervals_s[intervals_s > UNANSWERED_S].sum())
    share = 1.0 - silent_s / (wanted.to_s - wanted.from_s)
    if share >= verdict.share or not times_s.size:
        return verdict
    longest = int(intervals_s.argmax())
    reason = f"no answer from {edges_s[longest]:.1f} s to {edges_s[longest + 1]:.1f} s"
    return weighed(replace(verdict, share=share, reason="; ".join(filter(None, (verdict.reason, reason)))))
