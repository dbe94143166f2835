# Compiled by mypyc: it runs every tick.

"""What the links carry, watched once a second.

Over a full link rates go down by `levels.LEVELS`, one level at a time, until it isn't full any more. They go up again
once what the level above would need is well below what the link carried when it was full; and, as a link may carry
more than it did, after a time in any case, which is doubled whenever that fails.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from airlink.clock import LONG_AGO, Instant, seconds_between
from airlink.endpoint import VehicleId
from airlink.messages import Message
from formation_scenario import Scenario
from gcs_formation.budget.levels import LEVELS, Level
from gcs_formation.budget.traffic import STEADY_PROBE_S, UNSTATED, Stated, bytes_per_s, flight_hz, stated_by, thinned
from gcs_formation.features.link_budget.link_load import WINDOW, LinkLoad
from gcs_formation.features.link_budget.stream_rates import StreamRates
from gcs_formation.fleet.heartbeats import PROBE_S, HeartbeatScheduler
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.setpoint_delivery import EVERYTHING, LOSSY_S
from gcs_formation.vehicle.vehicle import Vehicle

NEAR: Final = 0.5
"""Share of a delay margin from which on nothing is held back: at 0.9 of that of a consensus, 1 m of error decayed at a
quarter of its rate else (`tests/gcs_formation/test_consensus_flight.py`). Tuned: share; 0.3 to 0.7; shown by `pytest
tests/gcs_formation/test_consensus_flight.py`."""
SETTLES_S: Final = 6.0
"""Time that a lower level gets to empty the queues. Tuned: s; 4 to 15; shown by `pytest
tests/gcs_formation/features/link_budget`."""
SILENT_S: Final = 0.5
"""Time without any frame from which on nothing more is asked for. Tuned: s; 0.3 to 1; shown by `pytest
tests/gcs_formation/features/link_budget`."""
CALM_S: Final = 20.0
"""Time without a full link before rates go up. Tuned: s; 10 to 60; shown by `pytest
tests/gcs_formation/features/link_budget`."""
ROOM: Final = 0.75
"""They go up if they would need less than this share of what the link carried when it was full, in turns and climbs.
Tuned: share; 0.5 to 0.9; shown by `pytest tests/gcs_formation/features/link_budget`."""
TRY_AGAIN_S, TRY_AGAIN_MAX_S = 120.0, 960.0
"""Or after this time, doubled after each time that the link was full again."""
TELLS: Final = 0.1
"""A level is in vain if the loss doesn't fall, where it would have to by more than this. Tuned: share; 0.08 to 0.15;
shown by `pytest tests/gcs_formation/features/link_budget`."""
IN_VAIN_S: Final = 12.0
"""Time at the lowest rates after which the link counts as bad instead of full. Tuned: s; 6 to 30; shown by `pytest
tests/gcs_formation/features/link_budget`."""


class VehicleBudget:
    """One vehicle's link: its load, and its level."""

    def __init__(self, vehicle: Vehicle, stated: Stated = UNSTATED) -> None:
        """Start with everything as often as it is of use; `stated`: what the scenario says that its radio carries."""
        self.vehicle, self.load, self.streams = vehicle, LinkLoad(vehicle), StreamRates(vehicle)
        self._all_hz, vehicle.setpoints.turn = dict(vehicle.start_up_hz), vehicle.index
        self.level = self._stated = stated.level
        self._since = self._full_at = self._raised = self._ignored_from = LONG_AGO
        """When the level was set, when the link was last full, when rates last went up, and since when a bad link has
        been left alone."""
        self.is_bad = False
        """Whether the rates were last given back because fewer bytes change nothing."""
        self._lost = 0.0
        """Share lost when the rates last went down."""
        self._carried, self._peak = stated.bytes_per_s, 0.0
        """What the link carried when it was full, and at most since the level has acted, bytes a second."""
        self._try_again_s, self._rates_of = TRY_AGAIN_S, (-1, False, False)
        self._careful_at = LONG_AGO
        """When a loop was last near its margin, or the link lost something."""

    def look(self, now: Instant, *, near: bool) -> None:
        """Save nothing while a loop is `near` its margin or the link loses, and for some time after, at full rates.

        Of one that isn't received rates stay: what a silence lost is counted by them.
        """
        vehicle = self.vehicle
        vehicle.setpoints.tolerance = EVERYTHING if near and not self.level else 1.0
        received = seconds_between(vehicle.connection.last_received, now) < SILENT_S
        if received and (near or seconds_between(vehicle.frames_lost_at, now) < LOSSY_S):
            self._careful_at = now

    def level_change(self, now: Instant) -> int:
        """Return by how many levels the rates go down (1 or 0), or up (-1, or as many as there are)."""
        at_level_s = seconds_between(self._since, now)
        if at_level_s >= SETTLES_S + WINDOW:  # what was under way at the level before is still carried until then
            self._peak = max(self._peak, self.load.bytes_per_s)
        limits = self.vehicle.limits
        if self.load.full:
            self._full_at, limits.full = now, self.load.words
            ignored = seconds_between(self._ignored_from, now) < self._try_again_s
            return 0 if ignored or at_level_s < SETTLES_S else self._lower(now, at_level_s)
        calm_s = seconds_between(self._full_at, now)
        limits.full = limits.full if calm_s < CALM_S else ""
        if self.level == self._stated or min(calm_s, at_level_s) < CALM_S:
            return 0
        if not self._has_room() and calm_s <= self._try_again_s:
            return 0
        self._raised = now
        return self._set(self.level - 1, now)

    def _lower(self, now: Instant, at_level_s: float) -> int:
        lowest = self.level == len(LEVELS) - 1
        if (lowest and at_level_s > IN_VAIN_S) or (self.level > self._stated + 1 and self._is_in_vain()):
            return self._give_up(now)
        if lowest:
            return 0
        if seconds_between(self._raised, now) < CALM_S:
            self._try_again_s = min(2.0 * self._try_again_s, TRY_AGAIN_MAX_S)
        self._carried, self._lost = self.load.bytes_per_s, self.load.lost
        return self._set(self.level + 1, now)

    def _set(self, level: int, now: Instant) -> int:
        change, self.level, self._since, self.is_bad = level - self.level, level, now, False
        self._peak = 0.0
        self.load.settle()
        self.streams.clear()
        return change

    def _give_up(self, now: Instant) -> int:
        self._ignored_from = now
        self.load.clear()
        change = self._set(self._stated, now)
        self.is_bad = True
        return change

    def _is_in_vain(self) -> bool:
        """Return whether the loss is nearer to that of the level above than to what a full link would lose now.

        A full link carries as much as before, so that it loses less of less: fewer bytes change nothing on one that
        has become longer and loses by itself. What the first level lost was counted while the link became full.
        """
        present, above = self._needed()
        if_full = max(0.0, 1.0 - (1.0 - self._lost) * above / present)
        return self._lost - if_full > TELLS and self.load.lost > (self._lost + if_full) / 2.0

    def _needed(self) -> tuple[float, float]:
        """Return the bytes a second that the level needs, and the one above."""
        autopilot, levels = self.vehicle.autopilot, self._levels()
        present, above = (bytes_per_s(autopilot, self._flight_hz(each), each) for each in levels)
        return present, above

    def _has_room(self) -> bool:
        present, above = self._needed()
        return max(above, above / present * self._peak) < ROOM * self._carried

    def _levels(self) -> tuple[Level, Level]:
        return LEVELS[self.level], LEVELS[self.level - 1]

    def apply(self, now: Instant) -> list[Message]:
        """Put the level into effect; return the requests for other rates."""
        vehicle, level, flies = self.vehicle, LEVELS[self.level], self.vehicle.start_up.finished
        whole = flies and self.level == 0 and seconds_between(self._careful_at, now) < LOSSY_S
        vehicle.limits.probe_s, vehicle.setpoints.interval_s = level.probe_s, level.setpoint_s
        vehicle.commands.spares = vehicle.setpoints.spares = self.level > 0
        restarted = vehicle.rates_hz is vehicle.start_up_hz
        if self._rates_of == (self.level, flies, whole) and not (restarted and flies):
            return []
        self._rates_of, before = (self.level, flies, whole), dict(vehicle.rates_hz)
        vehicle.start_up_hz.update(thinned(vehicle.autopilot, level, self._all_hz))
        vehicle.rates_hz = self._flight_hz(level) if flies and not whole else dict(vehicle.start_up_hz)
        asked = vehicle.start_up.asked_for_telemetry
        changed = [each for each, rate_hz in vehicle.rates_hz.items() if rate_hz != before[each]] if asked else []
        return [vehicle.ask(vehicle.autopilot.set_message_interval(each, vehicle.rates_hz[each])) for each in changed]

    def _flight_hz(self, level: Level) -> dict[int, float]:
        return flight_hz(self.vehicle.autopilot, level, self._all_hz)


class LinkBudget:
    """Keeps what goes over the links to what is of use, and what is of use to what they carry."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        log_event: LogEvent,
        reports: RadioReports,
        heartbeats: HeartbeatScheduler,
        stated: Mapping[VehicleId, Stated],
    ) -> None:
        """Watch `vehicles`; `reports`: of their radios, `stated`: of those that the scenario describes."""
        self._heartbeats = heartbeats
        self._each = [VehicleBudget(each, stated.get(identity, UNSTATED)) for identity, each in vehicles.items()]
        for each in self._each:
            each.apply(Instant(0))
        self._log_event, self._reports = log_event, reports

    def due_requests(
        self, now: Instant, margins_used: Sequence[float] = (), *, leaves_unread: bool = False
    ) -> list[tuple[Vehicle, Message]]:
        """Return the requests to send now; `margins_used`: shares of their delay margins that loops use.

        `leaves_unread`: messages that the station doesn't read are left at their rates, as for a second ground station.

        What is held back is a delay, too: where a loop has little of its margin left every change is sent.
        """
        found, changes = list[tuple[Vehicle, Message]](), dict[tuple[int, bool], list[VehicleBudget]]()
        for each in self._each:
            vehicle = each.vehicle
            each.look(now, near=_is_near(vehicle.index, margins_used))
            if not vehicle.connection.talks or vehicle.is_left:
                continue
            report = self._reports.of(vehicle.connection, now)
            each.load.look(now, None if report is None else float(report.txbuf_percent))
            change = each.level_change(now)
            if change:
                changes.setdefault((change, each.is_bad), []).append(each)
            found += [(vehicle, request) for request in self._requests(each, now, leaves_unread=leaves_unread)]
        for (change, _), those in changes.items():
            self._tell(change, those, now)
        return found

    def _requests(self, each: VehicleBudget, now: Instant, *, leaves_unread: bool) -> list[Message]:
        vehicle, level = each.vehicle, LEVELS[each.level]
        requests = each.apply(now)
        probe_s = level.probe_s or (STEADY_PROBE_S if vehicle.round_trips.steady else PROBE_S)
        self._heartbeats.spare(vehicle.identity, probe_s, irregular=level.probe_s > 0.0)
        if vehicle.start_up.finished or (each.level and vehicle.start_up.asked_for_telemetry):
            unread_hz = None if leaves_unread and not each.level else level.unread_hz
            requests += each.streams.requests(vehicle.rates_hz, unread_hz, now)
        return requests

    def _tell(self, change: int, those: list[VehicleBudget], now: Instant) -> None:
        """Record the change of some vehicles, which may share a radio: one event for all."""
        who = ", ".join(str(each.vehicle.identity) for each in those)
        level, shown = LEVELS[those[0].level], those[0].vehicle.limits.full
        of = f"the link of vehicle{'s' if len(those) > 1 else ''} {who}"
        if change > 0:
            text = f"{of} is full ({shown}): {level.words}"
        elif those[0].is_bad:
            text = f"{of} is bad, not full: fewer bytes change nothing, and {level.words} again"
        else:
            text = f"{of} has room again: {level.words}"
        one = those[0].vehicle if len(those) == 1 else None
        self._log_event(now, "link_load", text, one, {"vehicles": who, "level": those[0].level})


def _is_near(index: int, margins_used: Sequence[float]) -> bool:
    """Return whether a vehicle's loop is near its margin; one without a loop, which others follow, if any of these is.

    What one loop needs changes nothing on the links of others.
    """
    own = margins_used[index] if index < len(margins_used) else math.nan
    return any(used > NEAR for used in margins_used) if math.isnan(own) else own > NEAR


def link_budget(
    scenario: Scenario,
    vehicles: Mapping[VehicleId, Vehicle],
    log_event: LogEvent,
    reports: RadioReports,
    heartbeats: HeartbeatScheduler,
) -> LinkBudget:
    """Return the budget of the links of `vehicles`, of whose radios a scenario may state what they carry."""
    stated = stated_by(scenario, {identity: each.autopilot for identity, each in vehicles.items()})
    return LinkBudget(vehicles, log_event, reports, heartbeats, stated)
