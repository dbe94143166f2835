"""Where vehicles may be that don't fly as the law has it: that may not respond, go astray, or nobody commands."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from librt.vecs import vec
from mypy_extensions import i64

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
PROBE_S: Final = 0.27
"""How far apart requests are at most that every vehicle answers."""
MISSED_S: Final = 0.5
"""For how much longer answers may be missing: over links that lose, some are."""
STANDS: Triple = (0.0, 0.0, math.nan)
"""What one does that stands, or stops."""
SET_OFF: Final = (0.0, 1 / 3, 2 / 3, 1.0)
"""When it is reckoned to have set off: shares of the time in which it may have."""


class Place(NamedTuple):
    """Where one may be that may not respond."""

    column: int
    stands: int | None
    """Since when it stands; None: it flies on."""
    sets_off: int | None = None
    """Since when it flies home; None: it doesn't."""
    home_m: tuple[float, float] = (math.nan, math.nan)


class Unresponsive:
    """Predicts where vehicles are that may not respond: they fly on by the last setpoint that they surely heard.

    Or multirotors stand some time after the last setpoint, which was the one that they surely heard, or the last that
    was sent; or a failsafe takes them home from there.
    """

    def __init__(
        self, history: SetpointHistory, models: list[AutopilotModel], horizon_s: float, *, hovers: bool
    ) -> None:
        """Take the setpoints that were sent from `history`, the (C,) `models`, and how far ahead ways are looked at."""
        self._history, self._models, self._horizon_s, self._hovers = history, models, horizon_s, hovers
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
            answers = now - link.heard <= _suspect_after_s(link) * NANOSECONDS
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

    def traffic(
        self, members: list[int], now: Instant, links: list[VehicleLink], measured: Measured, at: int
    ) -> tuple[list[int], list[Triple], Traffic | None]:
        """Return those of the columns `members` that may not respond, as they are at the instant `at`.

        Each as often as there are places where it may be: the columns, what they are about there, and the traffic.
        """
        columns, about, states, leads_s = list[int](), list[Triple](), list[FlightState](), list[float]()
        for place in self._places(members, now, links, measured.stamps):
            state = measured.states[place.column].copy()
            found = self._flies(state, place, measured.stamps[place.column], at)
            if found is not None:
                setpoint, lead_s = found
                columns.append(place.column)
                about.append(setpoint)
                states.append(state)
                leads_s.append(lead_s)
        if not columns:
            return columns, about, None
        models, still = AutopilotModels.from_each(self._models[each] for each in columns), np.zeros(len(columns))
        return columns, about, Traffic(FlightStates.from_each(states), np.array(leads_s), still, models, self._hovers)

    def _places(self, members: list[int], now: Instant, links: list[VehicleLink], seen: vec[i64]) -> list[Place]:
        """Return where they may be; `seen`: when states were measured. Those show who has set off before."""
        found = [Place(each, None) for each in members if self._disobeying[each] or self._held[each]]
        for column in members:
            link, left = links[column], self._left[column]
            if self._held[column] is None or math.isinf(link.stands_after_s):
                continue
            after_ns, home_m = round(link.stands_after_s * NANOSECONDS), link.home_m
            if now < link.heard + after_ns - SOON_NS:
                continue
            for told in (link.heard,) if left is None else (link.heard, left):
                stands = told + after_ns
                found.append(Place(column, stands))
                first, last = max(stands, int(seen[column])), told + round(link.returns_after_s * NANOSECONDS)
                if home_m is not None and first <= last:
                    over_ns = min(max(now, first), last) - first
                    found += [Place(column, stands, first + round(share * over_ns), home_m) for share in SET_OFF]
        return found

    def _flies(self, state: FlightState, place: Place, begin: int, at: int) -> tuple[Triple, float] | None:
        """Fly a state on from an instant: as told, then standing, until it sets off for home or to the instant `at`.

        Returns what it is about then, and for how long it has been; None for one that is home by now.
        """
        model, stands, sets_off = self._models[place.column], place.stands, place.sets_off
        stands = at if stands is None else min(max(stands, begin), at)
        sets_off = at if sets_off is None else min(max(sets_off, begin), at)
        speed_mps, heading_rad, height_m = self._held[place.column] or UNKNOWN
        speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
        advance(state, model, speed_mps, heading_rad, height_m, max(stands - begin, 0) / NANOSECONDS)
        if place.stands is None:
            return UNKNOWN, 0.0
        if sets_off > stands:
            advance(state, model, 0.0, heading_rad, height_m, (sets_off - stands) / NANOSECONDS)
        if place.sets_off is None:
            return STANDS, 0.0
        setpoint, flown_s = homewards(state, place.home_m, model, self._horizon_s), (at - sets_off) / NANOSECONDS
        return (setpoint, flown_s) if setpoint[0] * flown_s < distance_m(state, place.home_m) else None


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

    @property
    def any_astray(self) -> bool:
        """Whether any multirotor doesn't fly the velocity that it is told."""
        for astray in self.astray:  # noqa: SIM110 - as above
            if astray:
                return True
        return False

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
            elapsed_s = float(measured.stamps[column] - before.stamps[column]) / NANOSECONDS
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
        home_m = tick.links[column].flies_home_m
        if home_m is None:
            return None
        return homewards(measured.states[column], home_m, self._models[column], self._horizon_s)


def _suspect_after_s(link: VehicleLink) -> float:
    """Return for how long a vehicle may be without a sign that it hears before it counts as one that may not.

    Its last sign is as old as the way back is long and requests are apart, where nothing is lost.
    """
    most_s = link.delay_s + PROBE_S + MISSED_S
    return most_s if most_s < UNANSWERED_S else UNANSWERED_S


def distance_m(state: FlightState, home_m: tuple[float, float]) -> float:
    """Return how far, level, a vehicle is from its home."""
    return math.hypot(home_m[0] - state.north_m, home_m[1] - state.east_m)


def homewards(state: FlightState, home_m: tuple[float, float], model: AutopilotModel, within_s: float) -> Triple:
    """Return the velocity, as speed and heading, at which a multirotor flies home, no sooner than in `within_s`."""
    speed_mps = min(model.speed_max_mps, distance_m(state, home_m) / within_s)
    return speed_mps, math.atan2(home_m[1] - state.east_m, home_m[0] - state.north_m), math.nan
