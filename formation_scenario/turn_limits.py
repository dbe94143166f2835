"""The tightest turns and the steepest climbs that every vehicle of a formation can fly in its slot, whatever its shape.

A slot outside a turn is flown faster than the leader, one inside slower, and while the turn begins their speeds change.
Of every limit a share is used; the law needs the rest to hold the slots.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.legs.heights import Climbs
from flight_model.legs.turn import STEEPEST, TurnLimits
from formation_scenario.fields import Frame
from formation_scenario.slot_assignment import Members, SlotStep, models_by_index
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.vehicles import VehicleModel

TURN_SHARE = 0.7
"""Share of the turn rate."""
SPEED_SHARE, ENERGY_SPEED_SHARE = 0.7, 0.6
"""Share of the speed range above and below the leader's speed; less under total-energy control, where larger changes of
airspeed cost metres of height."""
SETPOINT_SHARE = 0.9
"""Share of the speed range that a setpoint uses, which leads a change of speed by its time constant."""
ACCELERATION_SHARE = 0.7
"""Share of the acceleration: along the slots' path, and of multirotors also towards the turn's middle."""
GENTLEST = 0.02
"""Share of the turn rate below which turns aren't planned: feasibility says then which slot has no speed left."""
SHORTEST_S, LONGEST_S = 1.0, 60.0
"""Duration of a turn's beginning; it lasts at least a heading's time constant."""
WIDEST = 4.0
"""Multiple of the radius that single vehicles turn with, beyond which a formation turns badly."""
TRIED = 240
MIN_MPS = 1.0


def turn_limits(members: Members, steps: Sequence[SlotStep], speed_mps: float, wind_mps: float) -> TurnLimits:
    """Return the tightest turn that all can fly at an airspeed, with the wind behind the leader.

    Args:
        members: the vehicles and the frame of their slots.
        steps: their slots in every planned shape.
        speed_mps: the leader's airspeed.
        wind_mps: of the wind that drifts the vehicles.
    """
    speed_mps, models, frame = max(speed_mps, MIN_MPS), models_by_index(members), members.formation.frame
    max_rps = TURN_SHARE * min(each.turn_rate_max_rps for each in models)
    if any(each.hovers for each in models):
        accel_mps2 = min(each.accel_max_mps2 for each in models if each.hovers)
        max_rps = min(max_rps, ACCELERATION_SHARE * accel_mps2 / speed_mps)
    turn_rps = np.geomspace(GENTLEST, 1.0, TRIED) * max_rps
    kept = np.ones(TRIED, dtype=np.bool_)
    for step in steps:
        for side in (1.0, -1.0):
            kept &= _kept(models, step, frame, _flight(speed_mps, side * turn_rps, np.zeros(TRIED)))
    tightest_rps = float(turn_rps[max(int(np.argmin(np.append(kept, False))) - 1, 0)])
    begins_s = _begins_s(models, steps, frame, speed_mps, tightest_rps)
    over_mps = speed_mps + wind_mps
    return TurnLimits(tightest_rps / over_mps, STEEPEST * tightest_rps / (begins_s * over_mps**2))


def turns_well(members: Members, steps: Sequence[SlotStep], speed_mps: float, wind_mps: float) -> bool:
    """Return whether slots leave the formation turns that are at most `WIDEST` times as wide as the vehicles' own."""
    max_rps = TURN_SHARE * min(each.turn_rate_max_rps for each in models_by_index(members))
    own_1pm = max_rps / (max(speed_mps, MIN_MPS) + wind_mps)
    return WIDEST * turn_limits(members, steps, speed_mps, wind_mps).curvature_1pm >= own_1pm


def _begins_s(
    models: tuple[VehicleModel, ...], steps: Sequence[SlotStep], frame: Frame, speed_mps: float, turn_rps: float
) -> float:
    """Return the shortest time in which a turn can begin, and end, so that all slots keep up."""
    shortest_s = max(SHORTEST_S, *(each.tau_psi_s for each in models))
    share = np.linspace(0.0, 1.0, 17)
    rates, changes = turn_rps * share**2 * (3.0 - 2.0 * share), turn_rps * 6.0 * share * (1.0 - share)
    sides, directions = np.array([1.0, 1.0, -1.0, -1.0])[:, None], np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    for tried_s in np.split(np.geomspace(shortest_s, max(LONGEST_S, shortest_s), 80), 10):
        turn_rates = np.broadcast_to(sides * rates, (tried_s.size, 4, share.size))
        flight = _flight(speed_mps, turn_rates.ravel(), (directions * changes / tried_s[:, None, None]).ravel())
        kept = np.all([_kept(models, step, frame, flight) for step in steps], axis=0).reshape(tried_s.size, -1)
        if (flown := kept.all(axis=1)).any():
            return float(tried_s[np.argmax(flown)])
    return LONGEST_S


def _flight(speed_mps: float, turn_rps: Array, change_rps2: Array) -> LeaderFlight:
    level = np.zeros_like(turn_rps)
    return LeaderFlight(speed_mps, turn_rps, change_rps2, level, level)


def _kept(models: tuple[VehicleModel, ...], step: SlotStep, frame: Frame, flight: LeaderFlight) -> Mask:
    """Return at which of a flight's moments (K,) all followers keep their slots within their shares of the limits."""
    following = [column for column in range(len(models)) if column != step.arrangement.leader]
    if not following:
        return np.ones(flight.turn_rate_rps.shape, dtype=np.bool_)
    needs = slot_needs(flight, SlotMotion.at_rest(step.positions_m[following]), frame)
    each = [models[column] for column in following]
    share = np.array([SPEED_SHARE if model.airframe is None else ENERGY_SPEED_SHARE for model in each])
    low, high = np.array([model.soon_mps(flight.speed_mps) for model in each]).T
    turn = np.array([np.inf if model.hovers else model.turn_rate_max_rps for model in each])
    accel = ACCELERATION_SHARE * np.array([model.accel_max_mps2 for model in each])
    over, room_up, room_down = needs.speed_mps - flight.speed_mps, high - flight.speed_mps, flight.speed_mps - low
    kept = (over <= share * room_up) & (-over <= share * room_down)
    setpoint = over + np.array([model.tau_v_s for model in each]) * needs.accel_mps2
    kept &= (setpoint <= SETPOINT_SHARE * room_up) & (-setpoint <= SETPOINT_SHARE * room_down)
    kept &= (np.abs(needs.turn_rate_rps) <= (1.0 + TURN_SHARE) / 2.0 * turn) & (np.abs(needs.accel_mps2) <= accel)
    hovers = np.array([model.hovers for model in each])
    if hovers.any():  # their acceleration is one vector, also across the slots' path
        total_mps2 = np.hypot(needs.accel_mps2, needs.speed_mps * needs.turn_rate_rps)
        kept &= (total_mps2 <= accel) | ~hovers
    return np.asarray(kept.all(axis=1))


def climb_limits(members: Members, speed_mps: float, wind_mps: float) -> Climbs:
    """Return the steepest slope that all can fly at an airspeed, and how fast it may change.

    The climb rate may change by its limit within twice the sum of the height's time constants in (7).
    """
    models, speed_mps = [vehicle.model for vehicle in members.vehicles], max(speed_mps, MIN_MPS)
    climb_mps = min(model.climb_max_mps for model in models)
    tau_s = max(model.tau_ha_s + model.tau_hb_s for model in models)
    return Climbs(climb_mps / speed_mps, climb_mps / (2.0 * tau_s) / (speed_mps + wind_mps) ** 2)
