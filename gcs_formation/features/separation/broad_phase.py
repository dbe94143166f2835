# Compiled by mypyc: it runs every tick.

"""A fast test ahead of the separation rule, on plain numbers: whether any two vehicles could come too near at all.

Nearly always none could, and the rest of the rule is skipped. It is for formations in which every vehicle is commanded
and responds; `traffic.possible_pairs` has the same bound for all others.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.arrays import Array
from flight_model.autopilot_model import AutopilotModel, within, wrap
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.features.separation.approach import COARSE_S, JERK_MPS3

HALF_S: Final = COARSE_S / 2
SLOT_SHARE: Final = 0.8
"""Two vehicles keep at most this share of their slots' distance, planned transitions included, so that the rule doesn't
act against the formation. Tuned: share; 0.6 to 0.9; shown by `pytest tests/gcs_formation/features/separation`."""


class KeptDistance:
    """The distance that vehicles keep: for two that are commanded less where their slots are near each other."""

    __slots__ = ("each_m", "max_m", "rows")

    def __init__(self, max_m: float, each_m: Array | None = None, first: int = 0) -> None:
        """Take the largest distance, and those of pairs whose slots are moving.

        Args:
            max_m: from uncommanded vehicles, and where slots are far apart, or vehicles far from their slots.
            each_m: (C, C); None where slots rest: then it follows from the slots' distance.
            first: the first index that is a vehicle's.
        """
        self.max_m = max_m
        self.each_m = each_m
        self.rows: list[list[float]] = [] if each_m is None else each_m[first:, first:].tolist()
        """`each_m` of vehicles as lists, for `BroadPhase`."""


class VehicleBounds:
    """A vehicle's position, bounds of how far and how fast it may move from there, and its timing uncertainty."""

    __slots__ = ("along_m", "east_m", "far_m", "fast_mps", "index", "model", "north_m", "slot_m", "timing_s")

    def __init__(self, index: int, model: AutopilotModel) -> None:
        """Begin with a vehicle that hasn't been seen; `index`: its own."""
        self.index, self.model = index, model
        self.north_m = self.east_m = 0.0
        self.along_m = 0.0
        """Its position on the axis along which the vehicles are farthest apart."""
        self.far_m = self.fast_mps = 0.0
        """Largest distance and speed relative to the moving frame."""
        self.slot_m: Vector3 = (0.0, 0.0, 0.0)
        """From the leader: forward, right, up."""
        self.timing_s = 0.0
        """How much earlier or later than predicted it may be at a position."""


class BroadPhase:
    """Tests whether all pairs keep their distance while they fly as commanded and then along the reference's velocity.

    The test uses a frame that moves with the reference: the leader, along whose velocity the others can always fly. An
    error e of speed or heading that decays with a time constant tau, at a rate of at most r, displaces by e tau + e^2 /
    (2 r); the trapezium rule adds half a step. For multirotors the error is one of velocity.
    """

    def __init__(self, models: list[AutopilotModel], first_s: float, horizon_s: float, *, hovers: bool) -> None:
        """Look `horizon_s` ahead at vehicles with these models, which fly as commanded for `first_s`.

        `hovers`: they are multirotors.
        """
        self._hovers = hovers
        self._vehicles = [VehicleBounds(index, model) for index, model in enumerate(models)]
        self._order = list(self._vehicles)
        """Sorted along the axis on which they are farthest apart; the order seldom changes from tick to tick."""
        self._first_s, self._horizon_s = first_s, horizon_s
        self._reference: FlightState | None = None
        self._along_mps = self._along_rad = 0.0
        """Speed and heading along which the others can always fly: the reference's, of multirotors the commanded."""
        self._frame_north_mps = self._frame_east_mps = 0.0
        self._far_max_m = self._fast_max_mps = self._off_max_s = 0.0

    def begin_test(self, reference: FlightState, speed_mps: float, heading_rad: float) -> None:
        """Begin a test: `see` every vehicle, then ask whether `all_separated`. The reference is commanded these two."""
        self._reference = reference
        self._along_mps, self._along_rad = reference.airspeed_mps, reference.heading_rad
        self._frame_north_mps, self._frame_east_mps = reference.ground_mps()
        if self._hovers:
            self._along_mps, self._along_rad = speed_mps, heading_rad
            self._frame_north_mps = speed_mps * math.cos(heading_rad)
            self._frame_east_mps = speed_mps * math.sin(heading_rad)
        self._far_max_m = self._fast_max_mps = self._off_max_s = 0.0

    def see(
        self,
        index: int,
        state: FlightState,
        slot_m: Vector3,
        speed_mps: float,
        heading_rad: float,
        early_s: float,
        timing_s: float,
        accel_mps2: float,
    ) -> None:
        """Compute one vehicle's bounds.

        Args:
            index: among the models.
            state: when its present setpoint acts.
            slot_m: its slot from the leader; NaN for a vehicle far from its slot.
            speed_mps: commanded.
            heading_rad: commanded.
            early_s: from when its setpoint acts to the common instant at which the look-ahead begins.
            timing_s: timing uncertainty of its state.
            accel_mps2: present horizontal acceleration of a multirotor.
        """
        reference, vehicle, until_s = self._reference, self._vehicles[index], early_s + self._first_s
        assert reference is not None
        vehicle.slot_m = slot_m
        reference_mps, reference_rad, model = self._along_mps, self._along_rad, vehicle.model
        max_mps2, turn_rps = model.accel_max_mps2, model.turn_rate_max_rps
        along_mps = within(reference_mps, model.speed_min_mps, model.speed_max_mps)
        if self._hovers:
            slow_mps = _difference_mps(state, along_mps, reference_rad)
            step_mps = _difference_mps(state, speed_mps, heading_rad)
            off_rad = turn_rad = 0.0
        else:
            slow_mps = abs(along_mps - state.airspeed_mps)
            off_rad = abs(wrap(reference_rad - state.heading_rad))
            step_mps, turn_rad = speed_mps - state.airspeed_mps, wrap(heading_rad - state.heading_rad)
        slow_mps = _slower_mps(model, slow_mps, step_mps, until_s, accel_mps2 if self._hovers else math.nan)
        off_rad += min(abs(turn_rad) / model.tau_psi_s, turn_rps) * until_s
        along_m = slow_mps * (until_s + model.tau_v_s + HALF_S) + slow_mps * slow_mps / (2.0 * max_mps2)
        turned_s = off_rad * (until_s + model.tau_psi_s + HALF_S) + off_rad * off_rad / (2.0 * turn_rps)
        north_mps = state.wind_north_mps - reference.wind_north_mps
        east_mps = state.wind_east_mps - reference.wind_east_mps
        drift_mps = math.sqrt(north_mps * north_mps + east_mps * east_mps) + abs(along_mps - reference_mps)
        vehicle.north_m = state.north_m + self._frame_north_mps * early_s
        vehicle.east_m = state.east_m + self._frame_east_mps * early_s
        vehicle.far_m = along_m + along_mps * turned_s + drift_mps * (early_s + self._horizon_s)
        vehicle.fast_mps, vehicle.timing_s = slow_mps + along_mps * off_rad + drift_mps, timing_s
        self._far_max_m = max(self._far_max_m, vehicle.far_m)
        self._fast_max_mps = max(self._fast_max_mps, vehicle.fast_mps)
        self._off_max_s = max(self._off_max_s, timing_s)

    def all_separated(self, kept: KeptDistance) -> bool:
        """Return whether all seen vehicles keep their distance; pairs far apart along one axis are skipped."""
        max_m = kept.max_m + 2.0 * self._far_max_m + 4.0 * self._off_max_s * self._fast_max_mps
        self._sort()
        order = self._order
        for i in range(len(order)):
            one = order[i]
            for j in range(i + 1, len(order)):
                other = order[j]
                if other.along_m - one.along_m > max_m:
                    break
                off_m = (one.timing_s + other.timing_s) * (one.fast_mps + other.fast_mps)
                room_m = off_m + one.far_m + other.far_m
                north_m, east_m = other.north_m - one.north_m, other.east_m - one.east_m
                distance_m2, needed_m = north_m * north_m + east_m * east_m, kept.max_m + room_m
                if not distance_m2 >= needed_m * needed_m:
                    needed_m = _kept_m(kept, one, other) + room_m
                    if not distance_m2 >= needed_m * needed_m:
                        return False
        return True

    def _sort(self) -> None:
        """Sort the vehicles along the axis on which they are farther apart, by insertion from the previous order."""
        order = self._order
        south = north = order[0].north_m
        west = east = order[0].east_m
        for vehicle in order:
            south, north = min(south, vehicle.north_m), max(north, vehicle.north_m)
            west, east = min(west, vehicle.east_m), max(east, vehicle.east_m)
        northwards = north - south >= east - west
        for index in range(len(order)):
            vehicle = order[index]
            along_m = vehicle.along_m = vehicle.north_m if northwards else vehicle.east_m
            to = index
            while to > 0 and order[to - 1].along_m > along_m:
                order[to] = order[to - 1]
                to -= 1
            order[to] = vehicle


def _kept_m(kept: KeptDistance, one: VehicleBounds, other: VehicleBounds) -> float:
    """Return the distance that two vehicles keep: the largest if one of their slots isn't known."""
    first, second = one.slot_m, other.slot_m
    forward_m, right_m, up_m = first[0] - second[0], first[1] - second[1], first[2] - second[2]
    kept_m = SLOT_SHARE * math.sqrt(forward_m * forward_m + right_m * right_m + up_m * up_m)
    if kept.rows and not math.isnan(kept_m):
        kept_m = kept.rows[one.index][other.index]
    return kept_m if kept_m < kept.max_m else kept.max_m


def _difference_mps(state: FlightState, speed_mps: float, heading_rad: float) -> float:
    """Return the difference between a velocity and a state's velocity over ground."""
    north_mps, east_mps = state.ground_mps()
    return math.hypot(speed_mps * math.cos(heading_rad) - north_mps, speed_mps * math.sin(heading_rad) - east_mps)


def _slower_mps(model: AutopilotModel, slow_mps: float, step_mps: float, until_s: float, accel_mps2: float) -> float:
    """Return the largest error of speed when a setpoint has acted, of `slow_mps` before.

    A change of a multirotor's acceleration adds at most what `approach.CarriedOn` says, and what of that is still to
    come. NaN: of an aeroplane.
    """
    first_mps2 = min(abs(step_mps) / model.tau_v_s, model.accel_max_mps2)
    if math.isnan(accel_mps2):
        return slow_mps + first_mps2 * until_s
    change_mps2 = first_mps2 + accel_mps2
    first_mps2 = max(first_mps2, accel_mps2) + change_mps2 * change_mps2 / (2.0 * JERK_MPS3 * model.tau_v_s)
    slow_mps += first_mps2 * until_s
    change_mps2 = first_mps2 + min(slow_mps / model.tau_v_s, model.accel_max_mps2)
    return slow_mps + change_mps2 * change_mps2 / JERK_MPS3
