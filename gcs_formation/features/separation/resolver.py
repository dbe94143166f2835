# Compiled by mypyc: it runs every tick.

"""The separation rule in flight: builds the rule's input from a tick, and applies its decisions to the tick."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array, Indices
from flight_model.autopilot_model import AutopilotModel, squared, within
from flight_model.slot import UNKNOWN, Vector3
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario import Scenario
from formation_scenario.geofence import NO_LIMITS
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.transition_plan import MARGIN_M
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S, MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.accelerations import Accelerations
from gcs_formation.features.separation.approach import Traffic, sample_times
from gcs_formation.features.separation.broad_phase import SLOT_SHARE, BroadPhase, KeptDistance
from gcs_formation.features.separation.conflict_resolution import Resolution, resolve
from gcs_formation.features.separation.encounters import Encounters
from gcs_formation.features.separation.keys import SeparationKeys
from gcs_formation.features.separation.non_conforming import NonConforming, UncommandedMotion
from gcs_formation.features.separation.traffic import TrafficPicture
from gcs_formation.recorder import Tick

ROOM_M: Final = 0.5
"""Margin added to the distance to keep. A manoeuvre begins at the last moment, when the predicted trajectories leave
nothing to spare. Predictions are accurate to centimetres, with noisy states and trajectories that curve between samples
to decimetres."""
LEADS: Final[Vector3] = (0.0, 0.0, 0.0)
"""The leader's slot, from itself."""
AFAR: Final = 2.0
"""A vehicle farther from its slot than this many times the rule's distance keeps the full distance from all others."""
TIMING_SHARE: Final = 0.1
"""Timing uncertainty as a share of a state's age plus the one-way delay."""
RESERVE_TICKS: Final = 2.0
RESERVE_MIN_S, RESERVE_MAX_S = 0.2, 1.0
"""How much longer than a tick a setpoint is taken to act, in ticks within these limits: the next ones may be lost."""


class ConflictResolver:
    """Applies the rule tick by tick, and keeps track of the encounters."""

    def __init__(self, scenario: Scenario, history: SetpointHistory, models: list[AutopilotModel]) -> None:
        """Take the distance to keep; `history` holds the setpoints sent to the vehicles, (C,) `models`."""
        self._keys = SeparationKeys.of(scenario).avoidance
        self._enabled: bool = self._keys.enabled
        self._hovers: bool = scenario.hovers
        self._virtual, self._predicted = scenario.leader is None, scenario.law.delay_compensation
        self._ground, self._clearance_m = scenario.ground, scenario.safety.clearance_m
        self._heights_m = NO_LIMITS if scenario.fence is None else scenario.fence.heights_m
        self._history, self._models = history, models
        self._non_conforming = NonConforming(history, models, self._keys.horizon_s, hovers=self._hovers)
        self._uncommanded = UncommandedMotion(history, models, self._keys.horizon_s, hovers=self._hovers)
        self._accelerations = Accelerations(history, models, self._uncommanded, hovers=self._hovers)
        self._dt_s = 1.0 / scenario.law.rate_hz
        self._times_s = sample_times(_acts_s(self._dt_s), self._keys.horizon_s)
        self._first = 1 if self._virtual else 0
        """The first index that is a vehicle's."""
        until_s = float(self._times_s[1]), float(self._times_s[-1])
        self._broad_phase = BroadPhase(models[self._first :], *until_s, hovers=self._hovers)
        count, schedule = len(models), slot_schedule(scenario)
        self._side, self._manoeuvring_s = [0.0] * count, [0.0] * count
        self._slots: list[Vector3] = [
            (forward_m, right_m, up_m) for forward_m, right_m, up_m in schedule[0].positions_m
        ]
        """All vehicles' slots at the last tick that had any: there are none at the end of a flight."""
        self._afar = [False] * count
        self._slots_known: list[Vector3] | None = None
        """The list that `_slots` was made from; the same object means no change."""
        self._kept_m = self._keys.distance_m + ROOM_M
        self._limit_m: float = scenario.safety.separation_m
        self._kept_in_slots = self._kept_moving = KeptDistance(self._kept_m)
        self._separation_m: Array | None = None
        """The planned distances that `_kept_moving` was made from."""
        self._encounters = Encounters(scenario)

    def keep(self, tick: Tick, measured: MeasuredStates, separation_m: Array | None = None) -> None:
        """Replace those of a tick's setpoints that don't keep the distance.

        Two vehicles keep the rule's distance, or less where their slots, or the planned trajectories of these, leave
        less.

        Args:
            tick: with the law's setpoints; changed.
            measured: the newest states.
            separation_m: (C, C) minimum planned distances of moving slots; None where all slots rest where they belong.
                The same array for as long as the plan is the same.
        """
        if not self._enabled:
            return
        self._uncommanded.update(measured)
        self._watch_slots(tick.slots_m)
        self._watch_errors(tick)
        kept = self._kept_in_slots if separation_m is None else self.kept_while_moving(separation_m)
        self._non_conforming.update(tick.now, tick.links, tick.active)
        if self._none_near(tick, measured, kept):
            return
        members, stopped = self._members(tick), self._stopped(tick)
        if len(members) + len(stopped) < 2 or not members:
            return
        picture = self._picture(tick, measured, members, stopped, kept)
        side = np.array(self._side)[picture.vehicles]
        resolution = resolve(picture, np.where(picture.commanded, side, 0.0))
        self._replace(tick, picture.vehicles, resolution)
        self._encounters.log_events(tick, picture, resolution.conflicts, self._side)

    def kept_while_moving(self, separation_m: Array) -> KeptDistance:
        """Return the distances while slots change: the safety limit plus a margin, or more where plans allow it.

        Moving slots are no reason to go below a safe distance.
        """
        if separation_m is not self._separation_m:
            self._separation_m, limit_m = separation_m, self._limit_m
            min_m = np.maximum(np.minimum(separation_m - ROOM_M, limit_m + MARGIN_M), limit_m + ROOM_M)
            kept_m = np.minimum(np.maximum(SLOT_SHARE * separation_m, min_m), self._kept_m)
            self._kept_moving = KeptDistance(self._kept_m, kept_m, self._first)
        return self._kept_moving

    def _none_near(self, tick: Tick, measured: MeasuredStates, kept: KeptDistance) -> bool:
        """Return whether the rule can be skipped: all are commanded, respond, stay apart, and none avoids another."""
        if (
            not self._predicted
            or self._encounters.any
            or self._non_conforming.any
            or self._uncommanded.any_non_conforming
        ):
            return False
        first, acts, together = self._first, measured.acts, measured.acts[self._first]
        for index, active in enumerate(tick.active):
            if not active or self._side[index] != 0.0:
                return False
            if index >= first:
                if tick.age_s[index] >= FORGOTTEN_AFTER_S:
                    return False
                together = max(together, acts[index])
        look = self._broad_phase
        reference = max(first, tick.leader)
        look.begin_test(tick.state[reference], tick.setpoints[reference][0], tick.setpoints[reference][1])
        for index in range(first, len(acts)):
            speed_mps, heading_rad, _ = tick.setpoints[index]
            early_s, timing_s = float(together - acts[index]) / NANOSECONDS, _timing_s(tick, index)
            slot_m = self._slot(index)
            north_mps2, east_mps2 = self._accelerations.of(index, measured)
            accel_mps2 = math.sqrt(squared(north_mps2) + squared(east_mps2))
            look.see(index - first, tick.state[index], slot_m, speed_mps, heading_rad, early_s, timing_s, accel_mps2)
        return look.all_separated(kept)

    def _replace(self, tick: Tick, vehicles: Indices, resolution: Resolution) -> None:
        """Replace the law's setpoints by the rule's, and record which differ."""
        self._side = [0.0] * len(self._models)
        indices: list[int] = vehicles.tolist()
        sides: list[float] = resolution.side.tolist()
        commanded: list[list[float]] = resolution.setpoints.table.T.tolist()
        for index, side, (speed_mps, heading_rad, height_m) in zip(indices, sides, commanded, strict=True):
            if side:
                setpoint = speed_mps, heading_rad, height_m
                self._side[index] = side
                tick.replace(index, setpoint)
        tick.yielding = [side != 0.0 for side in self._side]
        self._manoeuvring_s = [
            lasted_s + self._dt_s if manoeuvres else 0.0
            for lasted_s, manoeuvres in zip(self._manoeuvring_s, tick.yielding, strict=True)
        ]

    def _members(self, tick: Tick) -> list[int]:
        """Return the vehicles that the rule considers: the leader first, multirotors far from their slots last."""
        counted = [
            index
            for index in range(self._first, len(self._models))
            if tick.age_s[index] < FORGOTTEN_AFTER_S and (tick.active[index] or tick.links[index].flew)
        ]
        if self._hovers:
            near_m = min(self._kept_m, SLOT_SHARE * _nearest_m(np.array(self._slots[self._first :])))
            counted.sort(key=lambda index: math.hypot(*tick.error_of(index)) > near_m)
        if tick.leader in counted:
            counted.remove(tick.leader)
            counted.insert(0, tick.leader)
        return counted

    def _stopped(self, tick: Tick) -> list[int]:
        """Return the vehicles whose states are too old, but which were commanded to stop: where they did isn't.

        One of which nothing is received is forgotten: whether it stopped, or is still there, is not known.
        """
        return [
            index
            for index in range(self._first, len(self._models))
            if tick.age_s[index] >= FORGOTTEN_AFTER_S
            and tick.links[index].brakes is not None
            and tick.links[index].airborne
        ]

    def _picture(
        self, tick: Tick, measured: MeasuredStates, members: list[int], stopped: list[int], kept: KeptDistance
    ) -> TrafficPicture:
        """Return the rule's input.

        A vehicle that may be at several positions is in it several times: one that may not respond and flies on or
        hovers; one that may turn tightly; a multirotor, non-conforming or uncommanded, that may keep accelerating or
        fly home.
        """
        acts: list[int] = [measured.acts[each] for each in members]
        together = max((at for at, each in zip(acts, members, strict=True) if tick.active[each]), default=min(acts))
        traffic = self._traffic(tick, measured, members, together)
        indices, setpoints_of, moved_s, others = self._non_conforming.traffic(
            members, stopped, tick.now, tick.links, measured, together
        )
        vehicles = [*members, *indices]
        commanded = [tick.active[each] for each in members]
        setpoints = [tick.setpoints[each] if tick.active[each] else UNKNOWN for each in members]
        if others is not None:
            traffic = traffic.followed_by(others)
            setpoints += setpoints_of
        circling = [at for at, each in enumerate(members) if tick.links[each].circling]
        if circling:
            loitering = traffic.select(np.array(circling))
            commanded_m = [tick.links[members[at]].holds_at_m for at in circling]
            traffic = traffic.followed_by(loitering.turning()).followed_by(loitering.turning()).followed_by(loitering)
            heights_m: list[float] = loitering.state.height_m.tolist()
            setpoints += [(math.nan, math.nan, each) for each in heights_m + commanded_m + commanded_m]
            vehicles += 3 * [members[at] for at in circling]
        uncommanded = self._uncommanded.intents(tick, members, measured)
        if uncommanded:
            traffic = traffic.followed_by(traffic.select(np.array([at for at, _ in uncommanded])))
            setpoints += [setpoint for _, setpoint in uncommanded]
            vehicles += [members[at] for at, _ in uncommanded]
        commanded += [False] * (len(vehicles) - len(members))
        moves_s = [math.inf] * len(members) + moved_s
        moves_s += [math.inf] * (len(vehicles) - len(moves_s))
        return TrafficPicture(
            traffic=traffic,
            setpoints=Setpoints.from_each(setpoints),
            commanded=np.array(commanded),
            vehicles=np.array(vehicles, dtype=np.intp),
            kept=kept,
            slots_m=np.array([self._slot(each) for each in vehicles]).T,
            timing_s=np.array([_timing_s(tick, each, max_s) for each, max_s in zip(vehicles, moves_s, strict=True)]),
            floor=self._floor_m,
            times_s=self._times_s,
            evades=self._side[members[0]] != 0.0,
            manoeuvring_s=np.array([self._manoeuvring_s[each] for each in vehicles]),
            heights_m=self._heights_m,
        )

    def _traffic(self, tick: Tick, measured: MeasuredStates, members: list[int], together: int) -> Traffic:
        """Return the vehicles `members` as they fly if they respond; predictions start at the instant `together`."""
        acts: list[int] = [measured.acts[each] for each in members]
        until = [at if tick.active[each] else together for at, each in zip(acts, members, strict=True)]
        turn_rps = np.array([0.0 if tick.active[each] else self._uncommanded.turn_rps[each] for each in members])
        lead_s = np.array([(together - each) / NANOSECONDS for each in until])
        models = AutopilotModels.from_each(self._models[each] for each in members)
        states = self._state(tick, measured, members, until, turn_rps)
        accel_mps2 = np.array([self._accelerations.of(index, measured) for index in members]).T
        return Traffic(states, lead_s, turn_rps, models, accel_mps2, self._hovers)

    def _state(
        self, tick: Tick, measured: MeasuredStates, members: list[int], until: list[int], turn_rps: Array
    ) -> FlightStates:
        """Return the states when setpoints act: the law's if it predicts them, else predicted here."""
        if self._predicted and all(tick.active[each] for each in members):
            return FlightStates.from_each(tick.state[each] for each in members)
        states = [measured.states[each].copy() for each in members]
        for state, index, end in zip(states, members, until, strict=True):
            self._history.carry(state, measured.stamps[index], end, index, self._models[index])
        stamps: list[int] = [measured.stamps[each] for each in members]
        over_s = np.array([(end - stamp) / NANOSECONDS for end, stamp in zip(until, stamps, strict=True)])
        return FlightStates.from_each(states).turned(turn_rps, over_s)

    def _floor_m(self, state: FlightStates) -> Array:
        """Return the lowest height that the rule commands: clear of the ground straight ahead.

        Where the ground isn't known, it is the present height.
        """
        over_s, (north_mps, east_mps) = self._times_s[:, None], state.ground_mps
        north_m, east_m = state.north_m + over_s * north_mps, state.east_m + over_s * east_mps
        ground_m = self._ground.height(north_m, east_m).max(axis=0)
        return np.where(np.isnan(ground_m), state.height_m, ground_m + self._clearance_m + self._keys.distance_m)

    def _watch_slots(self, slots_m: list[Vector3]) -> None:
        """Store the slots, the leader's (NaN) as 0; at the end of a flight, all NaN, the last ones are kept."""
        if slots_m is self._slots_known:
            return
        known = False
        for slot_m in slots_m:
            known = known or not math.isnan(slot_m[0])
        if known:
            self._slots = [LEADS if math.isnan(slot_m[0]) else slot_m for slot_m in slots_m]
            self._slots_known = slots_m

    def _watch_errors(self, tick: Tick) -> None:
        """Store which vehicles are far from their slots; at the end of a flight, without slots, keep the result."""
        far_m2 = squared(AFAR * self._kept_m)
        for index in range(len(self._afar)):
            forward_m, right_m, up_m = tick.error_of(index)
            if not math.isnan(forward_m):
                self._afar[index] = squared(forward_m) + squared(right_m) + squared(up_m) > far_m2

    def _slot(self, index: int) -> Vector3:
        """Return a vehicle's slot; unknown (NaN) if it is far from it, so not next to the neighbours of its slot."""
        return UNKNOWN if self._afar[index] else self._slots[index]


def _acts_s(dt_s: float) -> float:
    """Return for how long a setpoint is taken to act: until the next one that isn't lost."""
    return dt_s + within(RESERVE_TICKS * dt_s, RESERVE_MIN_S, RESERVE_MAX_S)


def _timing_s(tick: Tick, index: int, moves_s: float = FORGOTTEN_AFTER_S) -> float:
    """Return the timing uncertainty of a state, s, since which the vehicle has moved for so long at most."""
    age_s = min(tick.age_s[index], FORGOTTEN_AFTER_S, moves_s)
    timing_s = TIMING_SHARE * (age_s + tick.links[index].delay_s)
    return 0.0 if math.isnan(timing_s) else timing_s


def _nearest_m(slots_m: Array) -> float:
    """Return the distance of the two nearest slots; infinite for one."""
    one, other = np.triu_indices(len(slots_m), 1)
    return float(np.linalg.norm(slots_m[one] - slots_m[other], axis=1).min(initial=math.inf))
