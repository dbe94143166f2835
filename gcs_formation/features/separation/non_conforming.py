# Compiled by mypyc: it runs every tick.

"""Possible positions of vehicles that don't fly by the law's setpoints: non-conforming or uncommanded ones."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant
from flight_model.autopilot_model import AutopilotModel, advance, within, wrap
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Vector3
from flight_model.vehicle_arrays import AutopilotModels, FlightStates
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S, MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.approach import Traffic
from gcs_formation.recorder import Tick, VehicleLink
from gcs_formation.vehicle.vehicle_state import UNANSWERED_S

SOON_NS: Final = NANOSECONDS // 2
"""Lead time with which others keep clear of where an uncommanded vehicle would stop, as the age of its last answer is
known only roughly. Tuned: ns; 0.2 to 1 s; shown by `pytest tests/gcs_formation/features/separation`."""
ACCELERATION_S: Final = 0.5
"""Averaging time of the acceleration of a multirotor. Tuned: s; 0.3 to 1; by judgement."""
ACCELERATES_S: Final = 2.0
"""How long a non-conforming or uncommanded multirotor is assumed to keep accelerating. Tuned: s; 1 to 4; by
judgement."""
NON_CONFORMING_MPS, NON_CONFORMING_MPS2 = 1.5, 1.0
"""A multirotor is non-conforming if its velocity is so far from the commanded one and departs from it that fast."""
PROBE_S: Final = 0.27
"""Longest interval of requests that every vehicle answers. Tuned: s; the interval of requests; shown by `pytest
tests/gcs_formation/features/separation`."""
MISSED_S: Final = 0.5
"""How much longer answers may be missing, since links lose some. Tuned: s; 0.3 to 1; shown by `pytest
tests/gcs_formation/features/separation`."""
HOVERS: Vector3 = (0.0, 0.0, math.nan)
"""Intent of a vehicle that hovers or stops."""
SET_OFF: Final[tuple[float, ...]] = (0.0, 1 / 3, 2 / 3, 1.0)
"""Assumed times of its departure for home, as shares of the time in which it may depart."""


BLIND_NS: Final = 3 * NANOSECONDS // 2
"""A vehicle that is commanded to stop and has reported no position for so long stops where it isn't seen. Tuned: ns; 1
to 3 s; by judgement."""
BRAKES_NS: Final = (0, NANOSECONDS, 2 * NANOSECONDS)
"""How much later than the link's delay the command may reach it: it is repeated until it is acknowledged."""


class Candidate(NamedTuple):
    """A position that a vehicle may have if it doesn't respond."""

    vehicle_index: int
    hovers_at: int | None
    """Instant from which it hovers; None: it flies on."""
    sets_off: int | None = None
    """Instant from which it flies home; None: it doesn't."""
    home_m: tuple[float, float] = (math.nan, math.nan)
    held: Vector3 = UNKNOWN
    """Setpoint by which it flies on until it hovers."""


class NonConforming:
    """Predicts vehicles that may not respond: they fly on by the last setpoint that they are known to have received.

    A multirotor may also stop some time after its last setpoint, which is the last one that it is known to have
    received or the last one sent, and a failsafe may take it home from there.
    """

    def __init__(
        self, history: SetpointHistory, models: list[AutopilotModel], horizon_s: float, *, hovers: bool
    ) -> None:
        """Take the setpoints sent, the (C,) `models`, and how far ahead the rule predicts."""
        self._history, self._models, self._horizon_s, self._hovers = history, models, horizon_s, hovers
        self._held: list[Vector3 | None] = [None] * len(models)
        """Setpoint by which each vehicle that doesn't answer flies on; None for those that answer."""
        self._disobeying = [False] * len(models)
        self._stops: list[tuple[int, int, int, Vector3] | None] = [None] * len(models)
        """Of each that was commanded to stop without a position since: when, of when that is, and what it knew."""
        self._left: list[int | None] = [None] * len(models)
        """Instant from which each has been sent nothing; None while it is sent setpoints."""

    def update(self, now: Instant, links: list[VehicleLink], active: list[bool]) -> None:
        """Update which vehicles may not respond, and the setpoint that each holds; disobeying ones fly straight on.

        `active`: those that are sent setpoints.
        """
        for index, link in enumerate(links):
            if active[index]:
                self._left[index] = None
            elif self._left[index] is None:
                self._left[index] = now
            answers = now - link.received_at <= _suspect_after_s(link) * NANOSECONDS
            if answers:
                self._held[index] = None
            elif self._held[index] is None:
                self._held[index] = self._history.commanded(link.received_at, index)
            self._disobeying[index] = link.disobeying

    @property
    def any(self) -> bool:
        """Whether any vehicle may not respond."""
        for index, held in enumerate(self._held):  # noqa: SIM110 - compiled, `any` costs ten times as much
            if held is not None or self._disobeying[index]:
                return True
        return False

    def traffic(
        self,
        members: list[int],
        stopped: list[int],
        now: Instant,
        links: list[VehicleLink],
        measured: MeasuredStates,
        at: int,
    ) -> tuple[list[int], list[Vector3], list[float], Traffic | None]:
        """Return the possible positions, at the instant `at`, of those of the vehicles `members` that may not respond.

        `stopped`: vehicles whose states are too old, of which alone it is known where they stopped. For each position:
        the index, the vehicle's assumed intent, for how long it has moved since its state, and its index of the
        traffic.
        """
        indices, intents, states, leads_s = list[int](), list[Vector3](), list[FlightState](), list[float]()
        moved_s = list[float]()
        candidates = self._candidates(members, now, links, measured.stamps)
        for candidate in candidates + self._braking(stopped, now, links, measured.stamps):
            state = measured.states[candidate.vehicle_index].copy()
            found = self._flies(state, candidate, measured.stamps[candidate.vehicle_index], at)
            if found is not None:
                setpoint, lead_s = found
                indices.append(candidate.vehicle_index)
                intents.append(setpoint)
                states.append(state)
                leads_s.append(lead_s)
                moved_s.append(_moved_s(candidate, measured.stamps[candidate.vehicle_index]))
        if not indices:
            return indices, intents, moved_s, None
        models, still = AutopilotModels.from_each(self._models[each] for each in indices), np.zeros((3, len(indices)))
        traffic = Traffic(FlightStates.from_each(states), np.array(leads_s), still[0], models, still[1:], self._hovers)
        return indices, intents, moved_s, traffic

    def _candidates(
        self, members: list[int], now: Instant, links: list[VehicleLink], seen: vec[i64]
    ) -> list[Candidate]:
        """Return the possible positions; `seen`: when states were measured, which show departures before that."""
        found = [Candidate(each, None, held=self._held_by(each)) for each in members if self._may_not_respond(each)]
        found += self._braking(members, now, links, seen)
        for index in members:
            link, left = links[index], self._left[index]
            if self._held[index] is None or math.isinf(link.hovers_after_s):
                continue
            after_ns, home_m = round(link.hovers_after_s * NANOSECONDS), link.home_m
            if now < link.received_at + after_ns - SOON_NS:
                continue
            for received_at in (link.received_at,) if left is None else (link.received_at, left):
                hovers_at = received_at + after_ns
                held = self._held_by(index)
                found.append(Candidate(index, hovers_at, held=held))
                first, last = max(hovers_at, int(seen[index])), received_at + round(link.returns_after_s * NANOSECONDS)
                if home_m is not None and first <= last:
                    over_ns = min(max(now, first), last) - first
                    found += [
                        Candidate(index, hovers_at, first + round(share * over_ns), home_m, held) for share in SET_OFF
                    ]
        return found

    def _may_not_respond(self, index: int) -> bool:
        return self._disobeying[index] or self._held[index] is not None

    def _held_by(self, index: int) -> Vector3:
        return self._held[index] or UNKNOWN

    def _braking(self, members: list[int], now: Instant, links: list[VehicleLink], seen: vec[i64]) -> list[Candidate]:
        """Return where multirotors stop that were commanded to, and say no position since."""
        found = list[Candidate]()
        for index in members:
            brakes = links[index].brakes
            if brakes is None or now - seen[index] < BLIND_NS:
                continue
            begins, held = self._last_known(index, brakes, links[index].until_it_acts_s, int(seen[index]))
            found += [Candidate(index, begins + later_ns, held=held) for later_ns in BRAKES_NS]
        return found

    def _last_known(self, index: int, brakes: int, delay_s: float, seen: int) -> tuple[int, Vector3]:
        """Return when a command to stop came through, and the setpoint at the last position: kept, as histories end."""
        known = self._stops[index]
        if known is None or known[0] != brakes or known[1] != seen:
            comes, held = brakes + round(delay_s * NANOSECONDS), self._history.commanded(seen, index)
            if math.isnan(held[0]):  # the history has ended before the command
                held = self._held_by(index)
            known = self._stops[index] = brakes, seen, comes, held
        return known[2], known[3]

    def _flies(self, state: FlightState, candidate: Candidate, begin: int, at: int) -> tuple[Vector3, float] | None:
        """Predict a state from `begin`: by its setpoint, then hovering, until it sets off for home or the instant `at`.

        Return its intent then, and for how long it has had it; None for a vehicle that is home by now.
        """
        model, hovers_at, sets_off = self._models[candidate.vehicle_index], candidate.hovers_at, candidate.sets_off
        hovers_at = at if hovers_at is None else min(max(hovers_at, begin), at)
        sets_off = at if sets_off is None else min(max(sets_off, begin), at)
        speed_mps, heading_rad, height_m = candidate.held
        speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
        advance(state, model, speed_mps, heading_rad, height_m, max(hovers_at - begin, 0) / NANOSECONDS)
        if candidate.hovers_at is None:
            return UNKNOWN, 0.0
        if sets_off > hovers_at:
            advance(state, model, 0.0, heading_rad, height_m, (sets_off - hovers_at) / NANOSECONDS)
        if candidate.sets_off is None:
            return HOVERS, 0.0
        setpoint, flown_s = homewards(state, candidate.home_m, model, self._horizon_s), (at - sets_off) / NANOSECONDS
        return (setpoint, flown_s) if setpoint[0] * flown_s < distance_m(state, candidate.home_m) else None


def _moved_s(candidate: Candidate, begin: int) -> float:
    """Return for how long since its state a vehicle has moved at most, s: one that hovers is where it is, whenever."""
    if candidate.sets_off is not None:
        return math.inf
    if candidate.held[0] == 0.0:
        return 0.0
    return math.inf if candidate.hovers_at is None else max(candidate.hovers_at - begin, 0) / NANOSECONDS


class UncommandedMotion:
    """Estimates turn rates of uncommanded vehicles, accelerations of multirotors, and which are non-conforming."""

    def __init__(
        self, history: SetpointHistory, models: list[AutopilotModel], horizon_s: float, *, hovers: bool
    ) -> None:
        """Take the setpoints sent, the (C,) `models`, and how far ahead the rule predicts."""
        self._history, self._models, self._horizon_s, self._hovers = history, models, horizon_s, hovers
        self.turn_rps = [0.0] * len(models)
        """Turn rates of uncommanded vehicles."""
        self.non_conforming = [False] * len(models)
        """Whether a multirotor doesn't fly its commanded velocity."""
        self.accel_mps2 = [(0.0, 0.0)] * len(models)
        self._last: MeasuredStates | None = None

    @property
    def any_non_conforming(self) -> bool:
        """Whether any multirotor is non-conforming."""
        for non_conforming in self.non_conforming:  # noqa: SIM110 - as above
            if non_conforming:
                return True
        return False

    def update(self, measured: MeasuredStates) -> None:
        """Update turn rates, or multirotors' accelerations, from the last two states."""
        before, self._last = self._last, measured
        if before is None:
            return
        for active in measured.active:
            if not active or self._hovers:
                break
        else:
            return  # compiled, `all` costs ten times as much
        for index, model in enumerate(self._models):
            elapsed_s = float(measured.stamps[index] - before.stamps[index]) / NANOSECONDS
            if measured.active[index] and not self._hovers:
                self.turn_rps[index] = 0.0
            elif 0.0 < elapsed_s < FORGOTTEN_AFTER_S:
                then, now, max_rps = before.states[index], measured.states[index], model.turn_rate_max_rps
                if self._hovers:
                    self._watch_velocity(index, then.ground_mps(), now.ground_mps(), elapsed_s)
                    self.non_conforming[index] = measured.active[index] and self._leaves_command(index, measured)
                else:
                    turned_rad = wrap(now.heading_rad - then.heading_rad)
                    self.turn_rps[index] = within(turned_rad / elapsed_s, -max_rps, max_rps)

    def intents(self, tick: Tick, members: list[int], measured: MeasuredStates) -> list[tuple[int, Vector3]]:
        """Return other possible intents of multirotors: their indices in `members`, and velocities as setpoints."""
        if not self._hovers:
            return []
        free = [at for at, each in enumerate(members) if self.non_conforming[each] or not tick.active[each]]
        found = [(at, self._accelerated(members[at], measured)) for at in free]
        return found + [(at, home) for at in free if (home := self._homewards(tick, members[at], measured))]

    def _watch_velocity(
        self, index: int, then: tuple[float, float], now: tuple[float, float], elapsed_s: float
    ) -> None:
        share, (north_mps2, east_mps2) = min(elapsed_s / ACCELERATION_S, 1.0), self.accel_mps2[index]
        north_mps2 += share * ((now[0] - then[0]) / elapsed_s - north_mps2)
        east_mps2 += share * ((now[1] - then[1]) / elapsed_s - east_mps2)
        self.accel_mps2[index] = north_mps2, east_mps2

    def _leaves_command(self, index: int, measured: MeasuredStates) -> bool:
        """Return whether a multirotor's velocity departs from the commanded one, or has and doesn't return.

        A vehicle that had no setpoint a second ago is excluded: it may still be stopping.
        """
        commanded_mps, commanded_rad, _ = self._history.commanded(measured.stamps[index], index)
        if math.isnan(self._history.commanded(measured.stamps[index] - NANOSECONDS, index)[0]):
            return False
        (north_mps, east_mps), (north_mps2, east_mps2) = measured.states[index].ground_mps(), self.accel_mps2[index]
        north_mps, east_mps = (
            commanded_mps * math.cos(commanded_rad) - north_mps,
            commanded_mps * math.sin(commanded_rad) - east_mps,
        )
        off_mps = math.hypot(north_mps, east_mps)
        if not off_mps > NON_CONFORMING_MPS:
            return False
        back_mps2 = (north_mps * north_mps2 + east_mps * east_mps2) / off_mps
        return back_mps2 < -NON_CONFORMING_MPS2 or (self.non_conforming[index] and back_mps2 < NON_CONFORMING_MPS2)

    def _accelerated(self, index: int, measured: MeasuredStates) -> Vector3:
        """Return the velocity, as speed and heading, that a multirotor reaches if it keeps accelerating."""
        (north_mps, east_mps), (north_mps2, east_mps2) = measured.states[index].ground_mps(), self.accel_mps2[index]
        north_mps, east_mps = north_mps + ACCELERATES_S * north_mps2, east_mps + ACCELERATES_S * east_mps2
        return math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps), math.nan

    def _homewards(self, tick: Tick, index: int, measured: MeasuredStates) -> Vector3 | None:
        """Return the velocity of a multirotor's flight home; None if its mode doesn't take it there."""
        home_m = tick.links[index].flies_home_m
        if home_m is None:
            return None
        return homewards(measured.states[index], home_m, self._models[index], self._horizon_s)


def _suspect_after_s(link: VehicleLink) -> float:
    """Return how long a vehicle may give no sign of receiving setpoints before it counts as unresponsive.

    Without loss its last sign is as old as the one-way delay plus the interval of requests.
    """
    max_s = link.delay_s + PROBE_S + MISSED_S
    return max_s if max_s < UNANSWERED_S else UNANSWERED_S


def distance_m(state: FlightState, home_m: tuple[float, float]) -> float:
    """Return a vehicle's horizontal distance from its home."""
    return math.hypot(home_m[0] - state.north_m, home_m[1] - state.east_m)


def homewards(state: FlightState, home_m: tuple[float, float], model: AutopilotModel, within_s: float) -> Vector3:
    """Return the velocity, as speed and heading, at which a multirotor flies home, arriving in `within_s` or later."""
    speed_mps = min(model.speed_max_mps, distance_m(state, home_m) / within_s)
    return speed_mps, math.atan2(home_m[1] - state.east_m, home_m[0] - state.north_m), math.nan
