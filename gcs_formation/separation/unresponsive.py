"""Where vehicles may be that don't fly as the law has it: that may not respond, go astray, or nobody commands."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from flight_model.autopilot_model import AutopilotModel, FlightState, advance, within, wrap
from flight_model.slot import UNKNOWN, Triple
from flight_model.vehicle_arrays import AutopilotModels, FlightStates
from gcs_formation.estimation.projection import Measured
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.recorder import Tick, VehicleLink
from gcs_formation.separation.approach import Traffic
from gcs_formation.vehicle.vehicle import UNANSWERED_S

SOON_NS: Final = NANOSECONDS // 2
"""Before it would stand others make room for one that doesn't answer: how old its last answer is, is known roughly."""
SEEMS_AFTER_S: Final = 0.5
"""Over which the acceleration of a multirotor is averaged that nobody commands."""
SEEMS_FOR_S: Final = 2.0
"""For how long it may go on with it."""
ASTRAY_MPS, ASTRAY_MPS2 = 1.5, 1.0
"""A multirotor goes astray that is so far off the velocity that it is told and changes it so fast away from that."""
FORGOTTEN_AFTER_S: Final = 30.0
"""Age of a state that nobody keeps away from any more."""
Place = tuple[int, int | None]
"""The column of one that may not respond, and since when it stands there; None: it flies on."""


class Unresponsive:
    """Predicts where vehicles are that may not respond: they fly on by the last setpoint that they surely heard.

    Or they stand: an ArduCopter does some time after the last setpoint, which was the one that it surely heard, or the
    last that was sent.
    """

    def __init__(self, history: SetpointHistory, models: list[AutopilotModel], *, hovers: bool) -> None:
        """Take the setpoints that were sent from `history`, and the (C,) `models`."""
        self._history, self._models, self._hovers = history, models, hovers
        self._held: list[Triple | None] = [None] * len(models)
        """The setpoint that each vehicle flies on by that doesn't answer; None for those that answer."""
        self._disobeying = [False] * len(models)
        self._left: list[int | None] = [None] * len(models)
        """Since when each is sent nothing any more."""

    def watch(self, now: Instant, links: list[VehicleLink], active: list[bool]) -> None:
        """Note who may not respond, and the setpoint that each of them holds; who disobeys flies straight on.

        `active`: which are sent setpoints.
        """
        for column, link in enumerate(links):
            if active[column]:
                self._left[column] = None
            elif self._left[column] is None:
                self._left[column] = now
            answers = now - link.heard <= UNANSWERED_S * NANOSECONDS
            if answers:
                self._held[column] = None
            elif self._held[column] is None:
                self._held[column] = self._history.commanded(link.heard, column)
            self._disobeying[column] = link.disobeying

    @property
    def any(self) -> bool:
        """Whether any vehicle may not respond."""
        for column, held in enumerate(self._held):  # noqa: SIM110 - compiled, `any` costs ten times as much
            if held is not None or self._disobeying[column]:
                return True
        return False

    def places(self, members: list[int], now: Instant, links: list[VehicleLink]) -> list[Place]:
        """Return where those of the columns `members` may be that may not respond: each in up to three places."""
        found: list[Place] = [(each, None) for each in members if self._disobeying[each] or self._held[each]]
        for column in members:
            after_s, left = links[column].stands_after_s, self._left[column]
            if self._held[column] is None or math.isinf(after_s):
                continue
            since = links[column].heard + round(after_s * NANOSECONDS)
            if now >= since - SOON_NS:
                found.append((column, since))
                if left is not None:
                    found.append((column, left + round(after_s * NANOSECONDS)))
        return found

    def traffic(self, places: list[Place], measured: Measured, at: int) -> Traffic:
        """Return vehicles as they are at the instant `at` at places."""
        states: list[FlightState] = []
        for column, stands in places:
            state, begin, model = measured.states[column].copy(), measured.stamps[column], self._models[column]
            end = at if stands is None else min(stands, at)
            speed_mps, heading_rad, height_m = self._held[column] or UNKNOWN
            speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
            advance(state, model, speed_mps, heading_rad, height_m, max(end - begin, 0) / NANOSECONDS)
            stood_s = (at - max(end, begin)) / NANOSECONDS
            if stood_s > 0.0:
                advance(state, model, 0.0, heading_rad, height_m, stood_s)
            states.append(state)
        still = np.zeros(len(places))
        models = AutopilotModels.from_each(self._models[column] for column, _ in places)
        return Traffic(FlightStates.from_each(states), still, still, models, self._hovers)


class Wandering:
    """Learns how those turn that nobody commands, and how multirotors change their velocity, who may go astray."""

    def __init__(
        self, history: SetpointHistory, models: list[AutopilotModel], horizon_s: float, *, hovers: bool
    ) -> None:
        """Take the setpoints that were sent from `history`, the (C,) `models`, and how far ahead ways are looked at."""
        self._history, self._models, self._horizon_s, self._hovers = history, models, horizon_s, hovers
        self.turn_rps = [0.0] * len(models)
        """How fast each turns, if nobody commands it."""
        self.astray = [False] * len(models)
        """Which multirotors don't fly the velocity that they are told."""
        self._accel_mps2 = [(0.0, 0.0)] * len(models)
        self._last: Measured | None = None

    def watch(self, measured: Measured) -> None:
        """Learn from two states how those turn that nobody commands, or how multirotors change their velocity."""
        before, self._last = self._last, measured
        if before is None:
            return
        for active in measured.active:
            if not active or self._hovers:
                break
        else:
            return  # compiled, `all` costs ten times as much
        for column, model in enumerate(self._models):
            elapsed_s = (measured.stamps[column] - before.stamps[column]) / NANOSECONDS
            if measured.active[column] and not self._hovers:
                self.turn_rps[column] = 0.0
            elif 0.0 < elapsed_s < FORGOTTEN_AFTER_S:
                then, now, most_rps = before.states[column], measured.states[column], model.turn_rate_max_rps
                if self._hovers:
                    self._watch_velocity(column, then.ground_mps(), now.ground_mps(), elapsed_s)
                    self.astray[column] = measured.active[column] and self._goes_astray(column, measured)
                else:
                    turned_rad = wrap(now.heading_rad - then.heading_rad)
                    self.turn_rps[column] = within(turned_rad / elapsed_s, -most_rps, most_rps)

    def about(self, tick: Tick, members: list[int], measured: Measured) -> list[tuple[int, Triple]]:
        """Return what multirotors among `members` may be about besides, by their places there: speed and heading."""
        if not self._hovers:
            return []
        free = [at for at, each in enumerate(members) if self.astray[each] or not tick.active[each]]
        found = [(at, self._seems_about(members[at], measured)) for at in free]
        return found + [(at, home) for at in free if (home := self._homewards(tick, members[at], measured))]

    def _watch_velocity(
        self, column: int, then: tuple[float, float], now: tuple[float, float], elapsed_s: float
    ) -> None:
        share, (north_mps2, east_mps2) = min(elapsed_s / SEEMS_AFTER_S, 1.0), self._accel_mps2[column]
        north_mps2 += share * ((now[0] - then[0]) / elapsed_s - north_mps2)
        east_mps2 += share * ((now[1] - then[1]) / elapsed_s - east_mps2)
        self._accel_mps2[column] = north_mps2, east_mps2

    def _goes_astray(self, column: int, measured: Measured) -> bool:
        """Return whether a multirotor changes its velocity away from what it is told, or has and doesn't come back.

        One that was told nothing a second ago may still be stopping.
        """
        told_mps, told_rad, _ = self._history.commanded(measured.stamps[column], column)
        if math.isnan(self._history.commanded(measured.stamps[column] - NANOSECONDS, column)[0]):
            return False
        (north_mps, east_mps), (north_mps2, east_mps2) = measured.states[column].ground_mps(), self._accel_mps2[column]
        north_mps, east_mps = told_mps * math.cos(told_rad) - north_mps, told_mps * math.sin(told_rad) - east_mps
        off_mps = math.hypot(north_mps, east_mps)
        if not off_mps > ASTRAY_MPS:
            return False
        back_mps2 = (north_mps * north_mps2 + east_mps * east_mps2) / off_mps
        return back_mps2 < -ASTRAY_MPS2 or (self.astray[column] and back_mps2 < ASTRAY_MPS2)

    def _seems_about(self, column: int, measured: Measured) -> Triple:
        """Return the velocity, as speed and heading, that a multirotor comes to if it goes on as it accelerates."""
        (north_mps, east_mps), (north_mps2, east_mps2) = measured.states[column].ground_mps(), self._accel_mps2[column]
        north_mps, east_mps = north_mps + SEEMS_FOR_S * north_mps2, east_mps + SEEMS_FOR_S * east_mps2
        return math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps), math.nan

    def _homewards(self, tick: Tick, column: int, measured: Measured) -> Triple | None:
        """Return the velocity at which a multirotor may set off for home, None where its mode brings it nowhere."""
        home_m, state = tick.links[column].flies_home_m, measured.states[column]
        if home_m is None:
            return None
        to_north_m, to_east_m = home_m[0] - state.north_m, home_m[1] - state.east_m
        speed_mps = min(self._models[column].speed_max_mps, math.hypot(to_north_m, to_east_m) / self._horizon_s)
        return speed_mps, math.atan2(to_east_m, to_north_m), math.nan
