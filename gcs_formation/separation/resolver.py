"""The separation rule in flight: from a tick to what the rule looks at, and from what it decides back to the tick."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from airlink.clock import NANOSECONDS, Instant, seconds_between
from flight_model.arrays import Array, Instants, Mask, all_of, any_of, or_zero, within, wrap
from formation_scenario import Scenario, slot_schedule
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Indices, Setpoints
from gcs_formation.estimation.predictor import advance
from gcs_formation.estimation.projection import Measured
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.recorder import Tick
from gcs_formation.separation.first_look import Look, nobody_near
from gcs_formation.separation.manoeuvre import Traffic, sample_times
from gcs_formation.separation.rule import Conflict, Memory, Resolution, resolve
from gcs_formation.separation.traffic import Scene
from gcs_formation.vehicle.vehicle import UNANSWERED_S

ROOM_M = 0.5
"""How much more than the distance that is kept is reckoned with. Whoever gives way does so at the last moment, with
nothing to spare by the ways; those are known to centimetres where states are, and to decimetres where states are noisy
and ways are curved between the samples."""
SLOT_SHARE = 0.8
"""Share of the distance of the two nearest slots that is kept at most: the rule doesn't fight the formation."""
TIMING_SHARE = 0.1
"""Share of a state's age and of the way back by which instants may be off."""
RESERVE_S = 0.2
"""How much longer than a tick a setpoint is reckoned to act: the next one may be lost."""
FORGOTTEN_AFTER_S = 30.0
"""Age of a state that nobody keeps away from any more."""
STANDS_MPS = 3.0
"""Speed over ground and through the air below which a vehicle isn't flying."""


class Unresponsive:
    """Predicts where such vehicles are if they really don't respond: they fly on as they did when they last did."""

    def __init__(self, history: SetpointHistory, model: AutopilotModels) -> None:
        """Take the setpoints that were sent from `history`; `model` has (C,) columns."""
        self._history, self._model = history, model
        count = model.tau_v_s.size
        self._unanswering: Mask = np.zeros(count, dtype=bool)
        self._disobeying: Mask = np.zeros(count, dtype=bool)
        self._held = Setpoints.of(np.full((3, count), np.nan))

    def watch(self, now: Instant, heard: Instants, disobeying: Mask) -> None:
        """Note who may not respond, and the setpoint that each of them holds.

        Args:
            now: the tick's instant.
            heard: (C,) until when each vehicle is known to have heard what it was told.
            disobeying: (C,) which don't seem to fly as they were told, though they hear it: they fly straight on.
        """
        if heard.min() >= now - UNANSWERED_S * NANOSECONDS and not any_of(disobeying) and not self.any:
            return
        before, self._unanswering = self._unanswering, now - heard > UNANSWERED_S * NANOSECONDS
        self._disobeying = disobeying
        (since,) = np.nonzero(self._unanswering & ~before)
        if since.size:
            self._held.fill(since, self._history.told(heard[since], since))

    @property
    def any(self) -> bool:
        """Whether any vehicle may not respond."""
        return any_of(self._unanswering) or any_of(self._disobeying)

    def among(self, members: Indices) -> Indices:
        """Return those of some vehicles that may not respond."""
        return members[(self._unanswering | self._disobeying)[members]]

    def traffic(self, which: Indices, measured: Measured, at: np.int64) -> Traffic:
        """Return vehicles as they are at the instant `at` if they haven't responded since."""
        elapsed_s = np.maximum(at - measured.stamps[which], 0) / NANOSECONDS
        told, model = np.where(self._unanswering[which], self._held.take(which).table, np.nan), self._model.take(which)
        state = advance(measured.state.take(which), told[None], elapsed_s[None], model)
        return Traffic(state, np.zeros(which.size), np.zeros(which.size), model)


@dataclass
class Encounter:
    """A vehicle giving way to another, columns of a tick."""

    vehicle: int
    other: int
    begun: Instant
    nearest_m: float
    """How near they would come without the rule, when it began to act."""
    in_s: float
    upwards: bool
    least_m: float
    """Least distance since, as the states of the law have it."""
    ended: Instant | None = None


class ConflictResolver:
    """Applies the rule tick by tick, and remembers who gives way to whom."""

    def __init__(self, scenario: Scenario, history: SetpointHistory, model: AutopilotModels) -> None:
        """Take the distance to keep; `history` holds what was sent to the columns, (C,) `model`."""
        self._keys = scenario.safety.avoidance
        self._virtual, self._predicted = scenario.leader is None, scenario.law.delay_compensation
        self._ground, self._clearance_m = scenario.ground, scenario.safety.clearance_m
        self._history, self._model = history, model
        self._unresponsive = Unresponsive(history, model)
        self._dt_s = 1.0 / scenario.law.rate_hz
        self._times_s = sample_times(self._dt_s + RESERVE_S, self._keys.horizon_s)
        _, self._first_s, *_, self._horizon_s = self._times_s.tolist()
        columns = model.tau_v_s.size
        self._side, self._turn_rps = np.zeros(columns), np.zeros(columns)
        self._last: Measured | None = None
        self._slots, self._slots_moved = b"", True
        self._kept_from_others_m = self._keys.distance_m + ROOM_M
        slots = slot_schedule(scenario)
        self.kept_m = min(self._kept_from_others_m, *(self._kept_in(step.places_m) for step in slots))
        """Reckoned with between vehicles that are commanded."""
        self._encounters: dict[tuple[int, int], Encounter] = {}
        self.changes: list[Encounter] = []
        """What began or ended at the last tick."""
        self.replaced: Mask = np.zeros((columns, 3), dtype=bool)
        """Speed, heading and height of each column: what the law asked for isn't what is flown."""

    def rest(self) -> None:
        """Do nothing at a tick at which nobody is commanded."""
        self.changes = []

    def keep(self, tick: Tick, measured: Measured, heard: Instants, disobeying: Mask) -> Tick:
        """Return a tick with setpoints that keep the distance in the place of those that don't.

        Args:
            tick: with the law's setpoints.
            measured: the newest states.
            heard: (C,) until when each vehicle is known to have heard what it was told.
            disobeying: (C,) which don't seem to fly as they were told.
        """
        self.changes = []
        self.replaced[:] = False
        if not self._keys.enabled:
            return tick
        self._watch_turns(measured)
        self._watch_slots(tick.slots_m)
        self._unresponsive.watch(tick.now, heard, disobeying)
        if self._nobody_near(tick, measured):
            return tick
        members = self._members(tick, measured)
        if members.size < 2:
            return tick
        scene = self._scene(tick, measured, members, self._unresponsive.among(members))
        resolution = resolve(scene, Memory(np.where(scene.commanded, self._side[scene.vehicles], 0.0)))
        kept = self._kept(tick, scene.vehicles, resolution)
        self._note(tick.now, scene, resolution.conflicts)
        return kept

    def _nobody_near(self, tick: Tick, measured: Measured) -> bool:
        """Return whether all are commanded, respond and can't come near each other, and nobody gave way until now."""
        usual = self._predicted and not self._encounters and not np.count_nonzero(self._side)
        if not usual or self._unresponsive.any or not all_of(tick.active):
            return False
        first = 1 if self._virtual else 0
        ages_s, delays_s = tick.age_s[first:].tolist(), tick.delay_s[first:].tolist()
        if any(age_s >= FORGOTTEN_AFTER_S for age_s in ages_s):
            return False
        acts = measured.acts[first:].tolist()
        together, off_s = max(acts), [TIMING_SHARE * (age + delay) for age, delay in zip(ages_s, delays_s, strict=True)]
        return nobody_near(
            Look(
                states=tick.state.table[:, first:].T.tolist(),
                told=tick.setpoints.table[:, first:].T.tolist(),
                models=self._model.table[:, first:].T.tolist(),
                lead_s=[(together - each) / NANOSECONDS for each in acts],
                timing_s=[0.0 if math.isnan(each) else each for each in off_s],
                reference=max(0, tick.leader - first),
                kept_m=self.kept_m,
                first_s=self._first_s,
                horizon_s=self._horizon_s,
            )
        )

    def _kept(self, tick: Tick, vehicles: Indices, resolution: Resolution) -> Tick:
        """Return a tick with what the rule decided in the place of what the law did; remember where they differ."""
        yielding, setpoints = resolution.memory.yielding, Setpoints.of(tick.setpoints.table.copy())
        columns, told = vehicles[yielding], resolution.told.table[:, yielding]
        self._side[:] = 0.0
        self._side[columns] = resolution.memory.side[yielding]
        self.replaced[columns] = (told != setpoints.table[:, columns]).T
        setpoints.table[:, columns] = told
        return replace(tick, setpoints=setpoints, yielding=self._side != 0)

    def _members(self, tick: Tick, measured: Measured) -> Indices:
        """Return the columns that count, the leader's first."""
        counts = tick.active & (tick.age_s < FORGOTTEN_AFTER_S)
        if not all_of(tick.active):
            state = measured.state
            over_ground = np.hypot(state.wind_north_mps, state.wind_east_mps) + state.airspeed_mps
            counts |= (over_ground > STANDS_MPS) & (tick.age_s < FORGOTTEN_AFTER_S)
        counts[0] &= not self._virtual
        counted, leader = np.flatnonzero(counts), tick.leader
        if not counts[leader] or leader == 0:
            return counted
        return np.concatenate(([leader], counted[counted != leader])).astype(np.intp)

    def _scene(self, tick: Tick, measured: Measured, members: Indices, unresponsive: Indices) -> Scene:
        """Return what the rule looks at; those that may be unresponsive come once more, where they then are."""
        responding = tick.active[members]
        acts = measured.acts[members]
        together = acts[responding].max(initial=acts.min())
        until: Instants = np.where(responding, acts, together)
        turn_rps: Array = np.where(responding, 0.0, self._turn_rps[members])
        state = self._state(tick, measured, members, until, turn_rps)
        traffic = Traffic(state, (together - until) / NANOSECONDS, turn_rps, self._model.take(members))
        vehicles = np.concatenate((members, unresponsive))
        commanded = tick.active[vehicles]
        if unresponsive.size:
            traffic = traffic.beside(self._unresponsive.traffic(unresponsive, measured, together))
            commanded[members.size :] = False
        return Scene(
            traffic=traffic,
            told=Setpoints.of(np.where(commanded, tick.setpoints.table[:, vehicles], np.nan)),
            commanded=commanded,
            vehicles=vehicles,
            kept_m=self.kept_m,
            kept_from_others_m=self._kept_from_others_m,
            timing_s=TIMING_SHARE * or_zero(tick.age_s + tick.delay_s)[vehicles],
            reference=0,
            floor=self._floor_m,
            times_s=self._times_s,
        )

    def _state(
        self, tick: Tick, measured: Measured, members: Indices, until: Instants, turn_rps: Array
    ) -> FlightStates:
        """Return the states when setpoints act: the law's where it predicts, else predicted here."""
        commanded = tick.active[members]
        if self._predicted and all_of(commanded):
            return tick.state.take(members)
        begin, stamps = measured.state.take(members), measured.stamps[members]
        state = self._history.predict(begin, stamps, until, members, self._model.take(members))
        return state.turned(turn_rps, (until - stamps) / NANOSECONDS)

    def _floor_m(self, state: FlightStates) -> Array:
        """Return the height that vehicles may be sent down to: clear of the ground that they come to straight on."""
        over_s = self._times_s[:, None]
        north_m = state.north_m + over_s * state.airspeed_mps * np.cos(state.heading_rad)
        east_m = state.east_m + over_s * state.airspeed_mps * np.sin(state.heading_rad)
        return self._ground.height(north_m, east_m).max(axis=0) + self._clearance_m + self._keys.distance_m

    def _watch_turns(self, measured: Measured) -> None:
        """Learn from two states how those turn that nobody commands."""
        before, self._last = self._last, measured
        if before is None or all_of(measured.active):
            return
        elapsed_s = (measured.stamps - before.stamps) / NANOSECONDS
        fresh = (elapsed_s > 0) & (elapsed_s < FORGOTTEN_AFTER_S)
        turned = wrap(measured.state.heading_rad - before.state.heading_rad)
        rate = np.divide(turned, elapsed_s, out=self._turn_rps.copy(), where=fresh)
        most = self._model.turn_rate_max_rps
        self._turn_rps = np.where(measured.active, 0.0, within(rate, -most, most))

    def _watch_slots(self, slots_m: Array) -> None:
        """Take note of slots that stand nearer to each other than any of the scenario's."""
        content = slots_m.tobytes()
        if content == self._slots:
            if self._slots_moved:
                self.kept_m = min(self.kept_m, self._kept_in(or_zero(slots_m)))
            self._slots_moved = False
        else:
            self._slots, self._slots_moved = content, True

    def _kept_in(self, places_m: Array) -> float:
        """Return the distance that is kept between vehicles at places (C, 3) of a formation."""
        solid = places_m[1:] if self._virtual else places_m
        return SLOT_SHARE * _nearest_m(solid)

    def _note(self, now: Instant, scene: Scene, conflicts: tuple[Conflict, ...]) -> None:
        if not conflicts and not self._encounters:
            return
        state, vehicles = scene.traffic.state, scene.vehicles
        where = dict(zip(reversed(vehicles.tolist()), state.place_m[:, ::-1].T, strict=True))
        for conflict in conflicts:
            pair = int(vehicles[conflict.vehicle]), int(vehicles[conflict.other])
            if pair not in self._encounters:
                upwards = bool(self._side[pair[0]] > 0)
                begun = Encounter(*pair, now, conflict.nearest_m, conflict.in_s, upwards, np.inf)
                self._encounters[pair] = begun
                self.changes.append(begun)
        for pair, encounter in list(self._encounters.items()):
            if pair[0] in where and pair[1] in where:
                distance_m = float(np.linalg.norm(where[pair[0]] - where[pair[1]]))
                encounter.least_m = min(encounter.least_m, distance_m)
            if self._side[pair[0]] == 0:
                encounter.ended = now
                self.changes.append(self._encounters.pop(pair))


def words(encounter: Encounter, names: Mapping[int, str]) -> tuple[str, dict[str, str | int | float | bool | None]]:
    """Return what the record says of an encounter that begins or ends, in words and figures."""
    other = names[encounter.other]
    if encounter.ended is None:
        text = (
            f"gives way to {other}, {'upwards' if encounter.upwards else 'downwards'}: "
            f"they would be {encounter.nearest_m:.1f} m apart in {encounter.in_s:.1f} s"
        )
        return text, {"other": other, "begins": True, "nearest_m": encounter.nearest_m, "in_s": encounter.in_s}
    lasted_s = seconds_between(encounter.begun, encounter.ended)
    text = f"no longer gives way to {other}: {lasted_s:.1f} s, {encounter.least_m:.1f} m apart at least"
    return text, {"other": other, "begins": False, "least_m": encounter.least_m, "lasted_s": lasted_s}


def _nearest_m(slots_m: Array) -> float:
    """Return the distance of the two nearest slots; infinite for one."""
    if len(slots_m) < 2:
        return float("inf")
    one, other = np.triu_indices(len(slots_m), 1)
    return float(np.linalg.norm(slots_m[one] - slots_m[other], axis=1).min())
