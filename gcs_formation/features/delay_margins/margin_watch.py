# Compiled by mypyc: it runs every tick.

"""Delays of the loops in flight, compared with their margins and with the delay that the gains are designed for."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from formation_scenario.gains import AUTO, design_delay_s, redesigned
from gcs_formation.control.laws import law_kind
from gcs_formation.features.delay_margins.keys import DelayMarginKeys
from gcs_formation.recorder import Detail, LogEvent
from gcs_formation.stability import LoopDelay, Usage, law_usages, loop_delay_s
from gcs_formation.stability.mismatch import NEAR, TAUS_OFF_COUNTED
from gcs_formation.vehicle.vehicle import Vehicle

CLEAR: Final = 0.7
"""Share below which another event reports that this has ended. Tuned: share; 0.5 to 0.8; shown by `pytest
tests/gcs_formation/features/delay_margins`."""
DEGRADE: Final = 0.9
"""Share from which gains are reduced. Tuned: share; 0.8 to 0.95; shown by `pytest
tests/gcs_formation/features/delay_margins`."""
RESTORE: Final = 0.5
"""Share below which reduced gains are raised again, after `CALM_LOOKS` checks. Tuned: share; 0.3 to 0.6; by
judgement."""
LASTING_LOOKS: Final = 4
"""Number of checks, one a second, of which the smallest jitter counts: for up to 3 s after a step of the delay, round
trips before and after it are in one window and seem to jitter. Tuned: s; 3 to 6; shown by `pytest
tests/gcs_formation/features/delay_margins`."""
CALM_LOOKS: Final = 10
"""Number of checks, one a second: the standard deviation of a few round trips is itself uncertain. Tuned: s; 5 to 30;
shown by `pytest tests/gcs_formation/features/delay_margins`."""
HOLD_LOOKS: Final = 20
"""Longest hold by `law.on_delay`, of checks once a second. A leader at 22 m/s flies 440 m meanwhile. Tuned: s; 10 to
60; shown by `pytest tests/gcs_formation/features/delay_margins`."""
KEPT: Final = 0.7
"""Share in use after either change; fuzzy scheduling can reduce a margin to about 0.77 of itself. Tuned: share; 0.5 to
0.75; shown by `pytest tests/gcs_formation/features/delay_margins`."""
CHANNELS: Final = {"x": "speed", "y": "heading", "z": "height"}
INDICES: Final = {axis: [index] for index, axis in enumerate(CHANNELS)}
EVERY_INDEX: Final = list(range(len(CHANNELS)))
UNDESIGNED_S: Final = 0.05
"""Excess of the links' delay over the design delay from which gains are redesigned. Tuned: s; 0.02 to 0.1; by
judgement."""
SLOW_LOOKS: Final = 5
"""Number of checks, one a second, for which this must last in flight: a machine may just have been held up. Tuned: s; 3
to 10; shown by `pytest tests/gcs_formation/features/delay_margins`."""
DESIGN_STEP_S: Final = 0.01
"""Step to which design delays are rounded, so that few designs are computed. Tuned: s; 0.005 to 0.05; by
judgement."""


class DesignWatch:
    """Redesigns gains by design when links are slower than designed for; they never become faster again."""

    def __init__(
        self,
        scenario: Scenario,
        vehicles: dict[VehicleId, Vehicle],
        retunes: Sequence[Callable[[Scenario], None]],
        log_event: LogEvent,
    ) -> None:
        """Watch the links of `vehicles`; each of `retunes` is called with the scenario that has the new gains."""
        self.scenario = scenario
        """The scenario with the gains in force."""
        self._vehicles, self._retunes, self._log_event = vehicles, retunes, log_event
        kind = law_kind(scenario)
        self._designs = scenario.law.gains == AUTO and kind.has_margins and not kind.mutual
        self._slow_looks = 0

    def check_loops(self, now: Instant, *, begins: bool = False) -> None:
        """Check once a second: redesign gains after links have been too slow for `SLOW_LOOKS` checks.

        `begins`: before the first setpoint one check is enough.
        """
        if not self._designs:
            return
        delays_s = [each.clock.one_way_s for each in self._vehicles.values()]
        longest_s = max((each for each in delays_s if not math.isnan(each)), default=0.0)
        known_s = design_delay_s(self.scenario)
        self._slow_looks = self._slow_looks + 1 if longest_s > known_s + UNDESIGNED_S else 0
        if not self._slow_looks or not (begins or self._slow_looks >= SLOW_LOOKS):
            return
        self._slow_looks, delay_s = 0, round(longest_s / DESIGN_STEP_S) * DESIGN_STEP_S
        self.scenario = redesigned(self.scenario, delay_s)
        text = f"links take {longest_s * 1e3:.0f} ms each way: gains are designed for {delay_s * 1e3:.0f} ms"
        self._log_event(now, "design", f"{text}, instead of {known_s * 1e3:.0f} ms", None, self._details(delay_s))
        for retune in self._retunes:
            retune(self.scenario)

    def _details(self, delay_s: float) -> dict[str, Detail]:
        law = self.scenario.law
        gains = {
            f"{channel}_{gain}": float(getattr(getattr(law, channel), gain))
            for channel in CHANNELS.values()
            for gain in ("kp", "ki", "kd")
        }
        wind = law.disturbance_observer_radps
        return {"design_delay_s": delay_s, "disturbance_observer_radps": wind, **gains}


def channels_of(axis: str) -> list[int]:
    """Return the indices of the channels whose bandwidth an axis' loops share: one, or all under the consensus law."""
    return INDICES.get(axis, EVERY_INDEX)


class WatchedVehicle:
    """One vehicle's loops, and the recent jitter of its round trips."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Start without a check."""
        self.vehicle, self._jitters_s = vehicle, list[float]()
        self.axes = dict[str, Usage]()
        """By axis, what computes the share of the margin that its loops use; they share one bandwidth."""

        self.held, self.held_too_long = 0, False
        """Number of checks for which it was held, less those since; whether it follows with reduced gains instead."""

    def min_jitter_s(self) -> float:
        """Sample the jitter of its round trips; return the smallest of the last `LASTING_LOOKS`."""
        jitters_s, min_s = self._jitters_s, self.vehicle.clock.usual_jitter_s
        if len(jitters_s) == LASTING_LOOKS:
            jitters_s.pop(0)
        jitters_s.append(min_s)
        for each in jitters_s:
            min_s = min(min_s, each)
        return min_s


class MarginWatch:
    """Determines once a second how much of their margin each vehicle's loops use, and acts on it."""

    def __init__(self, scenario: Scenario, vehicles: dict[VehicleId, Vehicle], log_event: LogEvent) -> None:
        """Watch the loops that the law closes around `vehicles`."""
        self.used = [math.nan] * (1 + len(scenario.followers))
        """Share of the margin that each vehicle uses with the present gains, (C,); NaN while its delay is unknown."""
        self.bandwidth = [[1.0] * len(CHANNELS) for _ in self.used]
        """Share of the full bandwidth that the loops should have, (C, 3) by index and channel."""
        self.max_used = 0.0
        """Largest share so far; infinite if a loop is unstable without delay, NaN for a law without known loops."""
        self.longest_s = math.nan
        """Longest loop delay so far."""
        self._mutual = law_kind(scenario).mutual
        on_delay = DelayMarginKeys.of(scenario).on_delay
        self._degrades = on_delay == "degrade"
        self.holds = on_delay == "hold"
        """Whether vehicles beyond their margin are to be held."""
        self._waits_for_all = self._mutual and not scenario.law.delay_compensation
        self._rates_hz = scenario.telemetry.rate_hz, scenario.law.rate_hz
        self._log_event = log_event
        self.beyond: set[VehicleId] = set()
        """Vehicles with a loop that is unstable by its delay."""
        self._near: set[VehicleId] = set()
        self._time_constants_off = [[0.0] * len(self.used) for _ in CHANNELS]
        self._calm = Counter[tuple[VehicleId, str]]()
        self._watched = {identity: WatchedVehicle(vehicle) for identity, vehicle in vehicles.items()}
        self._each = list[WatchedVehicle]()
        """The vehicles around which the law closes loops."""
        self.retune(scenario)
        known = law_kind(scenario).has_margins
        for each in self._each:
            known |= bool(each.axes)
        if not known:
            self.max_used = math.nan

    def retune(self, scenario: Scenario) -> None:
        """Watch the loops closed with a scenario's gains."""
        self._each = []
        for identity, axes in law_usages(scenario, succession=True).items():
            each = self._watched[identity]
            each.axes = axes
            self._each.append(each)

    def check_loops(self, now: Instant, leader: Vehicle | None, time_constants_off: list[list[float]]) -> None:
        """Check every loop: report when it comes near its margin, and reduce gains if the scenario asks for that.

        The law closes a loop around the leader only if it is mutual. `time_constants_off`: relative error of each
        channel's time constants against the model in use, (3, C).
        """
        self._time_constants_off = time_constants_off
        for each in self._each:
            if each.vehicle is leader and not self._mutual:
                self._forget(each.vehicle)
            else:
                self._look(now, each)

    def _look(self, now: Instant, each: WatchedVehicle) -> None:
        vehicle, delay = each.vehicle, self._delay(each)
        index = vehicle.index
        if self._degrades or each.held_too_long:
            self._set_bandwidth(now, each, delay)
        by_delay, bandwidth = math.nan, self.bandwidth[index]  # NaN while the delay is unknown
        for axis, usage in each.axes.items():
            used = usage.of(delay, bandwidth[channels_of(axis)[0]])
            by_delay = by_delay if by_delay >= used else used
        by_taus, channel = self._by_time_constants(index, delay, each.axes)
        used = by_delay + by_taus
        self.used[index] = used
        self.max_used = max(self.max_used, used)
        if math.isnan(self.longest_s) or delay.mean_s > self.longest_s:
            self.longest_s = delay.mean_s
        self._say(now, vehicle, used, channel if by_taus > by_delay else None)
        if by_delay >= 1.0:
            self.beyond.add(vehicle.identity)
        elif each.held_too_long or not by_delay >= NEAR:  # its lower gains leave shares up to `DEGRADE` as they are
            self.beyond.discard(vehicle.identity)
        if self.holds:
            self._bound_hold(now, each)

    def _bound_hold(self, now: Instant, each: WatchedVehicle) -> None:
        """Let a vehicle that was held for `HOLD_LOOKS` follow with reduced gains, until it has the scenario's again."""
        vehicle = each.vehicle
        each.held = each.held + 1 if vehicle.identity in self.beyond else max(each.held - 1, 0)
        if not each.held_too_long and each.held >= HOLD_LOOKS:
            each.held_too_long = True
            text = f"was held for {HOLD_LOOKS} s by its delay: it follows with lower gains instead (on_delay: degrade)"
            self._log_event(now, "delay_margin", text, vehicle)
        elif each.held_too_long and not each.held and min(self.bandwidth[vehicle.index]) == 1.0:
            each.held_too_long = False

    def _by_time_constants(self, index: int, delay: LoopDelay, axes: dict[str, Usage]) -> tuple[float, int]:
        """Return the largest share of its margin against wrong time constants that a loop uses, and their channel."""
        maximum, whose = 0.0, 0
        for axis, usage in axes.items():
            for channel in channels_of(axis):
                off = self._time_constants_off[channel][index]
                used = usage.of_time_constants(delay, off) if off >= TAUS_OFF_COUNTED else 0.0
                if used > maximum:
                    maximum, whose = used, channel
        return maximum, whose

    def _forget(self, leader: Vehicle) -> None:
        """Forget the loops of a vehicle that has become the leader."""
        index = leader.index
        self.used[index], self.bandwidth[index] = math.nan, [1.0] * len(CHANNELS)
        self._near.discard(leader.identity)
        self.beyond.discard(leader.identity)

    def _delay(self, each: WatchedVehicle) -> LoopDelay:
        """Return the delay of a vehicle's loops; without prediction, consensus waits for the slowest downlink."""
        vehicle = each.vehicle
        down_s = own_down_s = vehicle.round_trips.down_s
        if self._waits_for_all:
            down_s = float(np.fmax.reduce([other.vehicle.round_trips.down_s for other in self._each]))
        up_s = 2.0 * vehicle.clock.one_way_s - own_down_s
        telemetry_hz, law_hz = self._rates_hz
        return LoopDelay(loop_delay_s(up_s, down_s, telemetry_hz, law_hz), each.min_jitter_s())

    def _set_bandwidth(self, now: Instant, each: WatchedVehicle, delay: LoopDelay) -> None:
        """Change the bandwidth of axes that use too much of the margin, or little with reduced gains."""
        vehicle, bandwidth, changed = each.vehicle, self.bandwidth[each.vehicle.index], False
        for axis, usage in each.axes.items():
            before = bandwidth[channels_of(axis)[0]]
            used, which = usage.of(delay, before), (vehicle.identity, axis)
            self._calm[which] = self._calm[which] + 1 if used < RESTORE else 0
            if used >= DEGRADE or (before < 1.0 and self._calm[which] >= CALM_LOOKS):
                after = usage.bandwidth(delay, KEPT)
                for channel in channels_of(axis):
                    bandwidth[channel] = after
                changed |= after != before
        if changed:
            used = max(usage.of(delay, bandwidth[channels_of(axis)[0]]) for axis, usage in each.axes.items())
            self._report_gains(now, vehicle, delay, used)

    def _say(self, now: Instant, vehicle: Vehicle, used: float, channel: int | None) -> None:
        """Report that a vehicle comes near its margin or is clear of it; `channel`: the one that uses most of it."""
        near = vehicle.identity in self._near
        if not near and used >= NEAR:
            self._near.add(vehicle.identity)
            text, details = f"uses {used:.0%} of its delay margin", dict[str, Detail](used=used)
            if math.isinf(used):
                text, details["used"] = "has no delay margin: its loops are unstable whatever the delay", None
            if channel is not None:
                off = self._time_constants_off[channel][vehicle.index]
                name = list(CHANNELS.values())[channel]
                text += f": {name} doesn't follow as its model says, time constants are {off:.0%} off"
                details["lags_off"] = off
            self._log_event(now, "delay_margin", text, vehicle, details)
        elif near and used < CLEAR:
            self._near.remove(vehicle.identity)
            self._log_event(now, "delay_margin", "is well inside its delay margin again", vehicle, {"used": used})

    def _report_gains(self, now: Instant, vehicle: Vehicle, delay: LoopDelay, used: float) -> None:
        shares = dict(zip(CHANNELS.values(), self.bandwidth[vehicle.index], strict=True))
        words = ", ".join(f"{channel} {share:.0%}" for channel, share in shares.items())
        lowered = min(shares.values()) < 1.0
        text = f"gains lowered; shares of the bandwidth: {words}" if lowered else "gains are the scenario's again"
        details: dict[str, Detail] = {f"bandwidth_{channel}": share for channel, share in shares.items()}
        self._log_event(now, "gains", text, vehicle, details | {"loop_delay_s": delay.mean_s, "used": used})
