"""The separation rule's first look, on plain numbers: whether any two vehicles could come too near at all.

Nearly always none could, and nothing else of the rule need be looked at. For formations of which every vehicle is
commanded and responds; `traffic.possible_pairs` has the same bound for all others.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot import AutopilotModel, FlightState, within, wrap
from flight_model.slot import Triple
from gcs_formation.separation.approach import COARSE_S

hypot: Final = math.hypot


class Spot:
    """Where a vehicle is, how far and how fast it may go from there, and how badly it is timed."""

    __slots__ = ("east_m", "far_m", "fast_mps", "north_m", "off_s")

    def __init__(self, north_m: float, east_m: float, far_m: float, fast_mps: float, off_s: float) -> None:
        """Take the place in m, how far in m and how fast in m/s it may go, and how much too early or late it is, s."""
        self.north_m = north_m
        self.east_m = east_m
        self.far_m = far_m
        self.fast_mps = fast_mps
        self.off_s = off_s


def nobody_near(  # noqa: PLR0913 - what there is to look at
    states: list[FlightState],
    setpoints: list[Triple],
    models: list[AutopilotModel],
    lead_s: list[float],
    timing_s: list[float],
    *,
    reference: int,
    kept_m: float,
    first_s: float,
    horizon_s: float,
) -> bool:
    """Return whether no two can come nearer than they are to keep, as commanded and then along the reference.

    Seen from a frame that moves on as the reference does. An error of speed or heading e that decays with a lag tau at
    a rate of r at most leads e tau + e^2 / (2 r) off; the trapezium rule, half a step more.

    Args:
        states: those of the (N,) vehicles when what they are commanded now acts.
        setpoints: what they are commanded, (N,).
        models: theirs, (N,).
        lead_s: how long before the instant that counting begins at, the same for all, their setpoints act, s, (N,).
        timing_s: how much earlier or later than reckoned each may be where it's reckoned to be, s, (N,).
        reference: the vehicle along whose velocity the others can always fly: the leader.
        kept_m: distance that two keep, m.
        first_s: how long they fly as commanded now, s.
        horizon_s: how far ahead is looked, s.
    """
    its = states[reference]
    its_mps, its_rad, spots = its.airspeed_mps, its.heading_rad, list[Spot]()
    frame_north_mps, frame_east_mps = its.ground_mps()
    far_most_m = fast_most_mps = off_most_s = 0.0
    half_s: float = COARSE_S / 2
    for place, state in enumerate(states):
        model, early_s, off_s = models[place], lead_s[place], timing_s[place]
        speed_mps, heading_rad, _ = setpoints[place]
        accel_mps2, turn_rps = model.accel_max_mps2, model.turn_rate_max_rps
        until_s = early_s + first_s
        along_mps = within(its_mps, model.speed_min_mps, model.speed_max_mps)
        step_mps, turn_rad = speed_mps - state.airspeed_mps, wrap(heading_rad - state.heading_rad)
        slow_mps = abs(along_mps - state.airspeed_mps) + min(abs(step_mps) / model.tau_v_s, accel_mps2) * until_s
        off_rad = abs(wrap(its_rad - state.heading_rad)) + min(abs(turn_rad) / model.tau_psi_s, turn_rps) * until_s
        along_m = slow_mps * (until_s + model.tau_v_s + half_s) + slow_mps * slow_mps / (2.0 * accel_mps2)
        aside_s = off_rad * (until_s + model.tau_psi_s + half_s) + off_rad * off_rad / (2.0 * turn_rps)
        wind_mps = hypot(state.wind_north_mps - its.wind_north_mps, state.wind_east_mps - its.wind_east_mps)
        drift_mps = wind_mps + abs(along_mps - its_mps)
        far_m = along_m + along_mps * aside_s + drift_mps * (early_s + horizon_s)
        fast_mps = slow_mps + along_mps * off_rad + drift_mps
        north_m, east_m = state.north_m + frame_north_mps * early_s, state.east_m + frame_east_mps * early_s
        spots.append(Spot(north_m, east_m, far_m, fast_mps, off_s))
        far_most_m, fast_most_mps = max(far_most_m, far_m), max(fast_most_mps, fast_mps)
        off_most_s = max(off_most_s, off_s)
    return _all_apart(spots, kept_m, kept_m + 2.0 * far_most_m + 4.0 * off_most_s * fast_most_mps)


def _all_apart(spots: list[Spot], kept_m: float, most_m: float) -> bool:
    """Return whether all keep their distance, `kept_m`: along one axis, those beyond `most_m` need no look."""
    order = _along_longer_side(spots)
    for i, (begin_m, here) in enumerate(order):
        one = spots[here]
        for j in range(i + 1, len(order)):
            at_m, there = order[j]
            if at_m - begin_m > most_m:
                break
            other = spots[there]
            needed_m = kept_m + (one.off_s + other.off_s) * (one.fast_mps + other.fast_mps) + one.far_m + other.far_m
            ahead_m, aside_m = other.north_m - one.north_m, other.east_m - one.east_m
            if not ahead_m * ahead_m + aside_m * aside_m >= needed_m * needed_m:
                return False
    return True


def _along_longer_side(spots: list[Spot]) -> list[tuple[float, int]]:
    """Return where spots are along the axis on which they are farther apart, in order, and which they are."""
    south = north = spots[0].north_m
    west = east = spots[0].east_m
    for spot in spots:
        south, north = min(south, spot.north_m), max(north, spot.north_m)
        west, east = min(west, spot.east_m), max(east, spot.east_m)
    northwards = north - south >= east - west
    order = [(spot.north_m if northwards else spot.east_m, place) for place, spot in enumerate(spots)]
    order.sort()
    return order
