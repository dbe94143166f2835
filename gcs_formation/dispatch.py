"""Sends setpoints so that those of all vehicles act at the same time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.delay_queue import DelayQueue
from airlink.identity import VehicleId
from airlink.messages import Message
from formation_scenario import Scenario
from gcs_formation.arrays import Array, Mask
from gcs_formation.controller import Links
from gcs_formation.membership import Member
from gcs_formation.recorder import Tick
from gcs_formation.setpoint import Setpoint, Whereabouts
from gcs_formation.vehicle.vehicle import Vehicle

HOLD_MAX_S = 1.0
"""Longest time for which the leader's setpoints are held back."""
WHEREABOUTS = [0, 1, 6, 7]
"""Rows of a state's table that a setpoint's whereabouts are."""
UNGUIDED_S = 2.0
"""For how long setpoints may be missing before a vehicle counts as left alone."""


class Dispatch:
    """Sends each vehicle its setpoints; the leader's are delayed until the slowest follower's act."""

    def __init__(
        self, scenario: Scenario, vehicles: Mapping[VehicleId, Vehicle], columns: Mapping[VehicleId, int]
    ) -> None:
        """Serve `vehicles`; `columns` are theirs in a tick."""
        self._virtual_leader = scenario.leader is None
        self._compensates = scenario.law.delay_compensation
        self._count = 1 + len(scenario.followers)
        self._vehicles = vehicles
        self._columns = columns
        self._held = DelayQueue[tuple[Vehicle, Message]]()
        self._without: dict[VehicleId, Instant] = {}
        """Since when there has been no setpoint for a vehicle that should get some."""

    def links(self, leader: int, disobeying: Mask, now: Instant) -> Links:
        """Return the present state of all links.

        Args:
            leader: the leading column.
            disobeying: (C,) columns that don't seem to fly as they were told.
            now: the tick's instant.
        """
        ready, delay_s, lag_s = np.zeros(self._count, dtype=bool), np.zeros(self._count), np.zeros(self._count)
        ways_s = np.full((self._count, 2), np.nan)
        jitter_s, airborne = np.full(self._count, np.nan), np.ones(self._count, dtype=bool)
        heard = np.full(self._count, now, dtype=np.int64)
        ready[0] = self._virtual_leader
        for identity, column in self._columns.items():
            vehicle = self._vehicles[identity]
            ready[column] = vehicle.member is Member.FLYING
            delay_s[column] = vehicle.clock.one_way_s
            ways_s[column] = vehicle.ways_s
            jitter_s[column] = vehicle.jitter.jitter_s
            airborne[column] = vehicle.airborne
            heard[column] = vehicle.heard_at(now)
            lag_s[column] = vehicle.autopilot.loop_s / 2
        links = Links(ready, delay_s, ways_s, jitter_s, lag_s, 0.0, airborne, heard, disobeying)
        hold_s = self._hold_s(leader, ready, links.up_s)
        lag_s[leader] += hold_s
        return links._replace(hold_s=hold_s)

    def take(self, tick: Tick, hold_s: float, now: Instant) -> None:
        """Take a tick's setpoints; one that isn't finite is never sent."""
        told, state = tick.setpoints, tick.state
        for identity, column in self._columns.items():
            setpoint = Setpoint(
                float(told.speed_mps[column]), float(told.heading_rad[column]), float(told.height_m[column])
            )
            where = Whereabouts(*state.table[WHEREABOUTS, column].tolist())
            finite = all(map(math.isfinite, (*setpoint, *where)))
            vehicle, usable = self._vehicles[identity], bool(tick.active[column]) and finite
            if usable or vehicle.member is not Member.FLYING:
                self._without.pop(identity, None)
            else:
                self._without.setdefault(identity, now)
            if usable:
                due = after(now, hold_s if column == tick.leader else 0.0)
                for message in vehicle.autopilot.setpoint(setpoint, where):
                    self._held.push(due, (vehicle, message))

    def unguided(self, now: Instant) -> frozenset[VehicleId]:
        """Return the vehicles that fly in the formation, and for which there have been no setpoints for a while."""
        return frozenset(each for each, since in self._without.items() if seconds_between(since, now) > UNGUIDED_S)

    def next(self) -> Instant | None:
        """Return when the next message is to be sent, None when none is held."""
        return self._held.next()

    def pop_due(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Remove and return the messages to send now; none to a vehicle that has left the formation meanwhile."""
        return [each for each in self._held.pop_due(now) if each[0].member is Member.FLYING]

    def clear(self) -> None:
        """Drop all messages that are held back: no setpoint may follow an order to loiter."""
        self._held = DelayQueue[tuple[Vehicle, Message]]()
        self._without.clear()

    def _hold_s(self, leader: int, ready: Mask, up_s: Array) -> float:
        """Return for how long the leader's setpoints are held back: until those of the slowest follower act.

        Otherwise a leader on a quicker link would turn before its followers can.
        """
        following = ready & (np.arange(self._count) != leader)
        if not self._compensates or not following.any():
            return 0.0
        slowest_s = float(np.fmax.reduce(up_s[following], initial=0.0))
        own_s = float(up_s[leader])
        return min(max(0.0, slowest_s - (0.0 if math.isnan(own_s) else own_s)), HOLD_MAX_S)
