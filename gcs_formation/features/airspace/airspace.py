# Compiled by mypyc: it runs every tick.

"""Airspace limits in flight: keeps setpoints inside the fence, and heights above the ground."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import Instant, seconds_between
from flight_model.arrays import Array, Indices, Mask, within, wrap
from flight_model.autopilot_model import AutopilotModel, respond
from flight_model.fence_geometry import CHECKED_M, FenceAreas, room_m
from flight_model.flight_state import FlightState
from flight_model.slot import HEIGHT
from flight_model.vehicle_arrays import FlightStates
from formation_scenario import Scenario
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.features.airspace.keys import AirspaceKeys, Fence
from gcs_formation.recorder import Event, Tick

HELD_M: Final = 10.0
"""A vehicle is turned away from the fence when the room left beyond such a turn is smaller. Tuned: m; 5 to 20; by
judgement."""
TURN_RAD: Final = np.pi / 2
"""Offset from the present heading that is commanded to turn a vehicle away: large enough for its tightest turn. Tuned:
rad; 1 to π; shown by `pytest tests/gcs_formation/features/airspace`."""
STEP_M: Final = 1.0
"""Distance over which the slope of the room to the fence is taken. Tuned: m; 0.5 to 5; by judgement."""
HELD_TAUS: Final = 0.5
"""Time, in time constants of height, for which a height setpoint is assumed to be held before the fastest climb
follows. Tuned: time constants; 0.3 to 1; shown by `pytest tests/gcs_formation/features/airspace`."""
TAUS: Final = [0.125, 0.25, 0.375, HELD_TAUS, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0]
"""Times, in time constants of height, at which the ground below that climb is checked. Tuned: time constants; 0 to 3,
denser at first; by judgement."""
TAUS_AHEAD: Final = np.array(TAUS)
SHARES: Final = [(TAUS.index(share), share) for share in (0.25, 0.5, 0.75, 1.0)]
"""Those of them, in shares of the time until a height is reached, at which the straight path there is checked."""
ROOM_M: Final = 0.25
"""Margin above terrain of that climb: ground and states are known to about that, and checked tick by tick. Tuned: m;
0.1 to 1; by judgement."""
AROUND_M: Final = 500.0
"""Radius around a vehicle in which the highest ground is searched, again after it has flown that far. Tuned: m; 300 to
2000; shown by `pytest tests/gcs_formation/features/airspace`."""
OVER_S: Final = 2.0
"""A limit has ended once it hasn't applied for so long, so that events don't repeat from tick to tick at a limit.
Tuned: s; 1 to 5; shown by `pytest tests/gcs_formation/features/airspace`."""


class HeldEvents:
    """Setpoints that are held at a limit: the beginning and the end of each hold is reported once."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with nothing held."""
        self._identities = ids_by_index(scenario)
        self._last = dict[tuple[int, str], Instant]()
        """When each vehicle was last held, by the text that will report the end of it."""

    def hold(self, tick: Tick, index: int, begins: str, ends: str) -> None:
        """Record that a vehicle's setpoint is held, and report it by one text; later its end by the other."""
        key = index, ends
        if key not in self._last:
            self._report(tick, index, begins, begins=True)
        self._last[key] = tick.now

    def report_ends(self, tick: Tick) -> None:
        """Report and forget what hasn't been held for `OVER_S`."""
        over = [key for key, since in self._last.items() if seconds_between(since, tick.now) > OVER_S]
        for index, ends in over:
            del self._last[index, ends]
            self._report(tick, index, ends, begins=False)

    def _report(self, tick: Tick, index: int, text: str, *, begins: bool) -> None:
        tick.events.append(Event(tick.now, "fence", text, self._identities[index], {"begins": begins}))


class FenceLimits:
    """Holds setpoints inside the fence, tick by tick: after the law, before the separation rule and the height floor.

    A vehicle is turned away when it is about to have no room inside for a circle to either side; until then the law's
    setpoints pass. Without room for any circle, it turns towards the inside by the smaller angle.
    """

    def __init__(self, scenario: Scenario, models: list[AutopilotModel]) -> None:
        """Take the scenario's fence; the (C,) `models` have the turn rates."""
        fence = AirspaceKeys.of(scenario).fence
        self._fenced, self._fence = fence is not None, fence or Fence()
        self._areas = self._fence.sides
        self._is_vehicle = np.array([each is not None for each in ids_by_index(scenario)])
        self._turn_rps = np.array([model.turn_rate_max_rps for model in models])
        self._side = np.zeros(self._is_vehicle.size)
        """-1 left, 1 right: side to which a vehicle is being turned away; else 0."""
        self._held = HeldEvents(scenario)

    def keep(self, tick: Tick) -> None:
        """Replace those of a tick's setpoints that lead out of the fence."""
        if not self._fenced:
            return
        active: Mask = tick.active & self._is_vehicle
        self._limit_heights(tick, active)
        if self._areas is not None:
            self._turn_away(tick, active, self._areas)
        self._held.report_ends(tick)

    def _limit_heights(self, tick: Tick, active: Mask) -> None:
        min_m, max_m = self._fence.heights_m
        for index in np.flatnonzero(active).tolist():
            speed_mps, heading_rad, height_m = tick.setpoints[index]
            if height_m < min_m or height_m > max_m:
                limit_m = min_m if height_m < min_m else max_m
                tick.replace(index, (speed_mps, heading_rad, limit_m))
                held = f"held at {limit_m:g} m"
                self._held.hold(tick, index, f"height {held}", f"height no longer {held}")

    def _turn_away(self, tick: Tick, active: Mask, areas: FenceAreas) -> None:
        if not active.any():
            return
        which = np.flatnonzero(active)
        state = FlightStates.from_each(tick.state[index] for index in which.tolist())
        position, velocity = np.stack((state.north_m, state.east_m), axis=-1), state.ground_mps.T
        through_air = state.airspeed_mps + np.hypot(state.wind_north_mps, state.wind_east_mps)
        room = room_m(areas, position, velocity, through_air, self._turn_rps[which])
        before = self._side[which]
        held = room.max(axis=1) < np.where(before != 0.0, CHECKED_M, HELD_M)
        widest = np.where(room[:, 1] >= room[:, 0], 1.0, -1.0)
        same = np.where(before > 0.0, room[:, 1], room[:, 0]) >= 0.0
        side = np.where(held, np.where((before != 0.0) & same, before, widest), 0.0)
        turn_rad = side * TURN_RAD
        lost = held & (room.max(axis=1) < 0.0)
        if lost.any():
            off_rad = wrap(_inward_rad(areas, position[lost]) - state.heading_rad[lost])
            turn_rad[lost] = within(off_rad, -TURN_RAD, TURN_RAD)
        turned: list[int] = which[held].tolist()
        headings_rad: list[float] = (state.heading_rad + turn_rad)[held].tolist()
        for index, heading_rad in zip(turned, headings_rad, strict=True):
            speed_mps, _, height_m = tick.setpoints[index]
            tick.replace(index, (speed_mps, heading_rad, height_m))
        self._log_boundary_events(tick, which, side, areas.inside_m(position))

    def _log_boundary_events(self, tick: Tick, which: Indices, side: Array, inside: Array) -> None:
        self._side[:] = 0.0
        self._side[which] = side
        for index, away, distance_m in zip(which.tolist(), side.tolist(), inside.tolist(), strict=True):
            if away:
                self._held.hold(tick, index, f"turned away, {distance_m:.0f} m inside", "no longer turned away")


def _inward_rad(areas: FenceAreas, position: Array) -> Array:
    """Return the heading towards the inside from positions (F, 2): where the distance to the edge grows most."""
    rise = [areas.inside_m(position + step) - areas.inside_m(position - step) for step in STEP_M * np.eye(2)]
    return np.arctan2(rise[1], rise[0])


class HeightFloor:
    """Holds heights at `safety.clearance_m` above the ground, tick by tick. It changes heights last, after the fence.

    A vehicle reaches a height setpoint after the time constants of its height. The straight path to that point is kept
    clear, so a vehicle that descends with the terrain may get a setpoint below the ground under it. Also kept clear is
    the path by its time constants and its present climb rate, if the setpoint is held for a while and the fastest climb
    follows: a vehicle that sinks takes time to climb. Setpoints never ask for more than the climb limit. Where the
    ground isn't known, there is no floor.
    """

    def __init__(self, scenario: Scenario, models: list[AutopilotModel]) -> None:
        """Take the scenario's ground; the (C,) `models` have the time constants of heights."""
        self._ground, self._level = scenario.ground, scenario.terrain is None
        self._clearance_m: float = scenario.safety.clearance_m
        self._room_m = 0.0 if self._level else ROOM_M
        self._models = models
        self._first = 0 if scenario.leader else 1
        """The first index that is a vehicle's."""
        self._known: list[tuple[float, float, float]] = [(math.nan, math.nan, math.nan)] * len(models)
        """Each one's position, north and east, at the last search for the highest ground, and a height clear of it."""
        self._held = HeldEvents(scenario)

    def keep(self, tick: Tick) -> None:
        """Replace those of a tick's heights that aren't clear of the ground."""
        low = [
            index
            for index in range(self._first, len(self._models))
            if tick.active[index] and tick.setpoints[index][HEIGHT] < self._clear_m(index, tick.state[index])
        ]
        for index, floors_m in zip(low, self._floors_m(tick, low), strict=True):
            speed_mps, heading_rad, height_m = tick.setpoints[index]
            min_m = self._min_m(tick.state[index], height_m, self._models[index], floors_m)
            if height_m < min_m:
                tick.replace(index, (speed_mps, heading_rad, min_m))
                held = f"height held at {min_m:.0f} m, {self._clearance_m:g} m above the ground"
                self._held.hold(tick, index, held, "height no longer held above the ground")
        self._held.report_ends(tick)

    def _clear_m(self, index: int, state: FlightState) -> float:
        """Return a height that is clear of all ground that a vehicle may be over soon."""
        if self._level:
            return self._clearance_m
        north_m, east_m, clear_m = self._known[index]
        model, (north_mps, east_mps) = self._models[index], state.ground_mps()
        ahead_m = TAUS[-1] * _tau_s(model) * math.hypot(north_mps, east_mps)
        if not math.hypot(state.north_m - north_m, state.east_m - east_m) + ahead_m <= AROUND_M:
            position = np.array([state.north_m]), np.array([state.east_m])
            clear_m = float(self._ground.bound_m(*position, max(AROUND_M, 2.0 * ahead_m))[0]) + self._clearance_m
            self._known[index] = state.north_m, state.east_m, clear_m
        return clear_m

    def _min_m(self, state: FlightState, height_m: float, model: AutopilotModel, floors_m: list[float]) -> float:
        """Return the lowest setpoint not below `height_m` on the way to which a vehicle stays above its floors."""
        max_m = state.height_m + _tau_s(model) * model.climb_max_mps
        highest_m = needed_m = -math.inf
        for index, share in SHARES:
            highest_m = max(highest_m, floors_m[index])
            needed_m = max(needed_m, state.height_m + (floors_m[index] - state.height_m) / share)
        min_m = max(height_m, min(needed_m, highest_m, max_m))
        if min_m >= max_m:
            return min_m
        low_m, share = _climbs(state, min_m, model), 0.0
        missing_m = [floor_m + self._room_m - low for floor_m, low in zip(floors_m, low_m, strict=True)]
        if max(missing_m) > 0.0:
            for missing, low, high in zip(missing_m, low_m, _climbs(state, max_m, model), strict=True):
                if missing > 0.0:  # as high as it can climb where no setpoint gains that much, as in sinking air
                    share = max(share, missing / (high - low) if missing < high - low else 1.0)
        return min_m + (max_m - min_m) * share

    def _floors_m(self, tick: Tick, which: list[int]) -> list[list[float]]:
        """Return the lowest clear heights at `TAUS` along vehicles' straight tracks; -inf over unknown ground."""
        if not which:
            return []
        states = [tick.state[index] for index in which]
        moving = [(each.north_m, each.east_m, *each.ground_mps()) for each in states]
        north_m, east_m, north_mps, east_mps = np.array(moving).T[:, :, None]
        over_s = np.array([_tau_s(self._models[index]) for index in which])[:, None] * TAUS_AHEAD
        ground_m = self._ground.height(north_m + over_s * north_mps, east_m + over_s * east_mps)
        floors_m: list[list[float]] = np.where(np.isnan(ground_m), -np.inf, ground_m + self._clearance_m).tolist()
        return floors_m


def _climbs(state: FlightState, commanded_m: float, model: AutopilotModel) -> list[float]:
    """Return the heights at `TAUS` if a setpoint is held first and the fastest climb follows."""
    flown, begun, heights_m, climb_m = state.copy(), 0.0, list[float](), _tau_s(model) * model.climb_max_mps
    for time_constants in TAUS:
        aim_m = commanded_m if time_constants <= HELD_TAUS else flown.height_m + climb_m
        respond(flown, model, math.nan, math.nan, aim_m, _tau_s(model) * (time_constants - begun))
        heights_m.append(flown.height_m)
        begun = time_constants
    return heights_m


def _tau_s(model: AutopilotModel) -> float:
    """Return how late a height is behind its setpoint on a climb, s."""
    return model.tau_ha_s + model.tau_hb_s
