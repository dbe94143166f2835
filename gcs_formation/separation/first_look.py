"""The separation rule's first look, on plain numbers: whether any two vehicles could come too near at all.

Nearly always none could, and nothing else of the rule need be looked at. For formations of which every vehicle is
commanded and responds; `traffic.possible_pairs` has the same bound for all others.
"""

from __future__ import annotations

import math
from operator import itemgetter
from typing import NamedTuple

from flight_model.autopilot import AutopilotModel, FlightState, within, wrap
from flight_model.slot import Triple
from gcs_formation.separation.manoeuvre import COARSE_S


class Look(NamedTuple):
    """What is looked at: N vehicles when what they are commanded now acts."""

    states: list[FlightState]
    setpoints: list[Triple]
    models: list[AutopilotModel]
    lead_s: list[float]
    """How long before the instant that counting begins at, the same for all, their setpoints act."""
    timing_s: list[float]
    """How much earlier or later than reckoned a vehicle may be where it's reckoned to be."""
    reference: int
    """The vehicle along whose velocity the others can always fly: the leader."""
    kept_m: float
    """Distance that two keep."""
    first_s: float
    """How long they fly as commanded now."""
    horizon_s: float


def nobody_near(look: Look) -> bool:
    """Return whether no two can come nearer than they are to keep, as commanded and then along the reference.

    Seen from a frame that moves on as the reference does. An error of speed or heading e that decays with a lag tau at
    a rate of r at most leads e tau + e^2 / (2 r) off; the trapezium rule, half a step more.
    """
    its = look.states[look.reference]
    its_mps, its_rad = its.airspeed_mps, its.heading_rad
    frame_north_mps, frame_east_mps = its.ground_mps()
    spots: list[tuple[float, float, float, float, float]] = []
    far_most_m = fast_most_mps = off_most_s = 0.0
    for state, setpoint, model, lead_s, off_s in zip(
        look.states, look.setpoints, look.models, look.lead_s, look.timing_s, strict=True
    ):
        accel_mps2, turn_rps = model.accel_max_mps2, model.turn_rate_max_rps
        first_s = lead_s + look.first_s
        along_mps = within(its_mps, model.speed_min_mps, model.speed_max_mps)
        step_mps, turn_rad = setpoint[0] - state.airspeed_mps, wrap(setpoint[1] - state.heading_rad)
        slow_mps = abs(along_mps - state.airspeed_mps) + min(abs(step_mps) / model.tau_v_s, accel_mps2) * first_s
        off_rad = abs(wrap(its_rad - state.heading_rad)) + min(abs(turn_rad) / model.tau_psi_s, turn_rps) * first_s
        along_m = slow_mps * (first_s + model.tau_v_s + COARSE_S / 2) + slow_mps * slow_mps / (2.0 * accel_mps2)
        aside_s = off_rad * (first_s + model.tau_psi_s + COARSE_S / 2) + off_rad * off_rad / (2.0 * turn_rps)
        wind_mps = math.hypot(state.wind_north_mps - its.wind_north_mps, state.wind_east_mps - its.wind_east_mps)
        drift_mps = wind_mps + abs(along_mps - its_mps)
        far_m = along_m + along_mps * aside_s + drift_mps * (lead_s + look.horizon_s)
        fast_mps = slow_mps + along_mps * off_rad + drift_mps
        north_m, east_m = state.north_m + frame_north_mps * lead_s, state.east_m + frame_east_mps * lead_s
        spots.append((north_m, east_m, far_m, fast_mps, off_s))
        far_most_m, fast_most_mps = max(far_most_m, far_m), max(fast_most_mps, fast_mps)
        off_most_s = max(off_most_s, off_s)
    return _all_apart(spots, look.kept_m, look.kept_m + 2.0 * far_most_m + 4.0 * off_most_s * fast_most_mps)


def _all_apart(spots: list[tuple[float, float, float, float, float]], kept_m: float, most_m: float) -> bool:
    """Return whether all keep their distance: along one axis, those beyond `most_m` need no look.

    Args:
        spots: north and east; how far, and how fast, vehicles may go from there; how badly they are timed.
        kept_m: what all keep.
        most_m: the most that any two need.
    """
    north, east = [spot[0] for spot in spots], [spot[1] for spot in spots]
    axis = 0 if max(north) - min(north) >= max(east) - min(east) else 1
    spots.sort(key=itemgetter(axis))
    for i, (north_m, east_m, far_m, fast_mps, off_s) in enumerate(spots):
        begin_m = spots[i][axis]
        for j in range(i + 1, len(spots)):
            other = spots[j]
            if other[axis] - begin_m > most_m:
                break
            needed_m = kept_m + (off_s + other[4]) * (fast_mps + other[3]) + far_m + other[2]
            ahead_m, aside_m = other[0] - north_m, other[1] - east_m
            if not ahead_m * ahead_m + aside_m * aside_m >= needed_m * needed_m:
                return False
    return True
