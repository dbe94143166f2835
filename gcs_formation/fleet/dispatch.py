"""Sends setpoints so that they take effect at the same time."""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NEVER, Instant, after
from airlink.endpoint import VehicleId
from airlink.engine import DelayQueue
from airlink.messages import Message
from flight_model.autopilot_model import finite
from flight_model.flight_state import Setpoint
from flight_model.slot import Vector3
from formation_scenario import Scenario
from formation_scenario.slot_assignment import models_by_index
from gcs_formation.fleet.unguided import Unguided
from gcs_formation.recorder import Tick, VehicleLink
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

HOLD_MAX_S: Final = 1.0
"""Longest time for which the leader's setpoints are delayed."""


class Dispatch:
    """Sends setpoints; the leader's are delayed so that they take effect with the slowest follower's."""

    def __init__(self, scenario: Scenario, vehicles: dict[VehicleId, Vehicle]) -> None:
        """Start without setpoints."""
        self._virtual_leader = scenario.leader is None
        self._compensates = scenario.law.delay_compensation
        self._count = 1 + len(scenario.followers)
        self._vehicles = list(vehicles.values())
        self._at_once: list[tuple[Vehicle, Message]] = []
        self._held = DelayQueue[tuple[Vehicle, Message]]()
        self.due = NEVER
        """When the next message is to be sent."""
        self._guided = [False] * self._count
        """Whether each vehicle got a setpoint at this tick, (C,)."""
        self._unguided = Unguided(self._count)
        self._last_due = vec[i64]([0] * self._count)
        """When each vehicle's newest setpoint is to be sent, (C,)."""
        self._dead_s = [each.dead_time_s for each in models_by_index(scenario)]
        """The autopilots' dead times, (C,)."""

    def links(self, leader: int, disobeying: list[bool], now: Instant) -> tuple[list[VehicleLink], float]:
        """Return every vehicle's present link, and for how long setpoints of vehicle `leader` are held back, s.

        `disobeying`: (C,) whether each vehicle seems not to fly as commanded.
        """
        links = [VehicleLink(now) for _ in self._guided]
        links[0].ready = self._virtual_leader
        for vehicle in self._vehicles:
            link, clock = links[vehicle.index], vehicle.clock
            link.ready = vehicle.member is Member.FLYING
            link.delay_s, link.asymmetry_s = clock.one_way_s, clock.asymmetry_s
            if vehicle.round_trips.knows_asymmetry:
                link.up_s, link.down_s = vehicle.round_trips.up_down_s
            link.jitter_s = vehicle.jitter.jitter_s
            link.airborne, link.flew = vehicle.airborne, vehicle.flew
            may_loiter = vehicle.may_loiter
            if may_loiter or not link.ready:
                link.circling, link.flies_home_m = vehicle.circles, vehicle.flies_home_m
                link.holds_at_m = math.nan if vehicle.member is Member.PARTED else vehicle.holds_at_m
                if vehicle.autopilot.hovers and vehicle.member is Member.HOLDING:
                    link.brakes = vehicle.holds_from
            link.received_at = vehicle.round_trips.received_at(now)
            link.dead_s = self._dead_s[vehicle.index]
            link.further_delay_s = clock.loop_s / 2 + link.dead_s
            link.disobeying = may_loiter or disobeying[vehicle.index]
            link.speeds_mps = vehicle.autopilot.speeds_mps
            link.hovers_after_s, link.returns_after_s = vehicle.hovers_after_s, vehicle.returns_after_s
            link.home_m = vehicle.telemetry.home_m
        hold_s = self._hold_s(leader, links)
        links[leader].further_delay_s += hold_s
        return links, hold_s

    def accept(self, tick: Tick, hold_s: float, now: Instant) -> None:
        """Take a tick's setpoints; one that isn't finite is never sent."""
        evades = any(tick.yielding)
        for vehicle in self._vehicles:
            index = vehicle.index
            state = tick.state[index]
            vehicle.setpoints.hurries = evades
            speed_mps, heading_rad, height_m = tick.setpoints[index]
            known = state.north_m + state.east_m + state.height_m + state.wind_north_mps + state.wind_east_mps
            usable = tick.active[index] and finite(speed_mps + heading_rad + height_m + known)
            self._guided[index] = usable
            self._unguided.update(index, guided=usable or vehicle.member is not Member.FLYING, now=now)
            if usable:
                due = after(now, hold_s) if index == tick.leader else now
                if due < self._last_due[index]:
                    self._drop(vehicle, due)
                self._last_due[index] = due
                messages = vehicle.new_setpoints(Setpoint(speed_mps, heading_rad, height_m), state, due)
                self._send(vehicle, messages, due, now)
            else:
                vehicle.forget_setpoints()

    def held(self, tick: Tick) -> list[Vector3]:
        """Put into a tick what vehicles hold from then on, and return it: what is no news wasn't sent."""
        for vehicle in self._vehicles:
            if self._guided[vehicle.index]:
                tick.setpoints[vehicle.index] = vehicle.setpoints.held.values
        return tick.setpoints

    def _drop(self, vehicle: Vehicle, after_this: Instant) -> None:
        """Drop a vehicle's setpoints delayed until after newer ones, and send the newer ones in full."""
        self._held.drop(lambda due, each: each[0] is vehicle and due > after_this)
        vehicle.forget_setpoints()

    def _send(self, vehicle: Vehicle, messages: list[Message], due: Instant, now: Instant) -> None:
        for message in messages:
            if due <= now:
                self._at_once.append((vehicle, message))
            else:
                self._held.push(due, (vehicle, message))
        self.due = min(self.due, due)

    def stand_ins(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return substitute setpoints for vehicles that need a stream and have none, for a limited time."""
        found = list[tuple[Vehicle, Message]]()
        for vehicle in self._vehicles:
            if self._guided[vehicle.index]:
                self._guided[vehicle.index] = False
            elif vehicle.start_up.acted and not self._unguided.is_so(vehicle.index, now):
                found += [(vehicle, message) for message in vehicle.autopilot.stand_in()]
        return found

    def unguided(self, now: Instant) -> frozenset[VehicleId]:
        """Return the vehicles that fly in the formation and have had no setpoints for a while."""
        return frozenset(each.identity for each in self._vehicles if self._unguided.is_so(each.index, now))

    def pop_due(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Remove and return the messages to send now; none for a vehicle that has left the formation meanwhile."""
        if now < self.due:
            return []
        due = self._held.pop_due(now)
        due += self._at_once
        self._at_once = []
        held = self._held.next()
        self.due = NEVER if held is None else held
        return [each for each in due if each[0].member is Member.FLYING]

    def clear(self) -> None:
        """Drop all delayed messages: no setpoint may follow a command to loiter."""
        self._held, self._at_once, self.due = DelayQueue[tuple[Vehicle, Message]](), [], NEVER
        for vehicle in self._vehicles:
            vehicle.forget_setpoints()
        self._unguided.clear()

    def _hold_s(self, leader: int, links: list[VehicleLink]) -> float:
        """Return the delay of the leader's setpoints, s: until the slowest follower's setpoints take effect.

        Without it a leader on a quicker link would turn before its followers can.
        """
        if not self._compensates:
            return 0.0
        own_s, slowest_s = links[leader].until_it_acts_s, 0.0
        for index, link in enumerate(links):
            if link.ready and index != leader and link.until_it_acts_s > slowest_s:
                slowest_s = link.until_it_acts_s
        return min(max(0.0, slowest_s - (0.0 if math.isnan(own_s) else own_s)), HOLD_MAX_S)
