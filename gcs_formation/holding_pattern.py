"""How the leader flies before its path: circles in which all slots keep up, then straight, so that followers settle."""

from __future__ import annotations

import math

import numpy as np

from flight_model.fence_geometry import Flyers, HoldingPatternFence
from formation_scenario import Scenario
from formation_scenario.slot_assignment import models_by_index, slot_schedule, slot_table
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from gcs_formation.control.follower import swing_share
from gcs_formation.guidance.leader_guidance import FIRST_STRAIGHT_S, SETTLE_S

HOLD_SHARE = 0.8
"""Share of the speed range above and below the path's speed that turns before the path may use."""
ENERGY_HOLD_SHARE = 0.6
"""The same for aircraft under total-energy control: larger changes of airspeed cost metres of height, and the run-in
would be too short to return to the slots."""
HOLD_TURN_SHARE = 0.5
"""Share of the turn rate limit that turns before the path may use."""
SWING_RAD = math.radians(15.0)
"""Largest difference between a follower's heading and the leader's there: entering a turn sweeps slots sideways."""
GENTLEST_RPS = 0.01
"""Least turn rate before the path; vehicles that can't keep up in that catch up on the run-in."""


def settle_s(scenario: Scenario) -> float:
    """Return how long the leader flies straight between a turn and its path, s, for followers to reach their slots.

    In `follower_heading` they leave a turn late, and aircraft under total-energy control later still.
    """
    own_frame = scenario.formation.frame == "follower_heading"
    by_energy = any(each.airframe is not None for each in models_by_index(scenario)[1:])
    return 2.0 * SETTLE_S if own_frame and by_energy else SETTLE_S


def first_straight_s(scenario: Scenario) -> float:
    """Return the shortest straight at the end of the leader's first way, s: longer for slower heading loops.

    In `follower_heading` those of vehicles at the side are: three ArduPlanes in a line were out of their slots by up to
    14 m in turns, across, and by 3.3 m after 30 s.
    """
    if scenario.formation.frame != "follower_heading" or scenario.hovers:
        return FIRST_STRAIGHT_S
    right_m = float(np.nanmax(np.abs(slot_schedule(scenario)[0].positions_m[:, 1])))
    return FIRST_STRAIGHT_S / swing_share(right_m, scenario.path.begin_mps)


def pattern_fence(scenario: Scenario) -> HoldingPatternFence | None:
    """Return the fence within which the formation's holding patterns before the path must stay, None without one."""
    sides = None if scenario.fence is None else scenario.fence.sides
    if sides is None:
        return None
    first = 0 if scenario.leader else 1
    forward_m, right_m, _ = slot_schedule(scenario)[0].positions_m[first:].T
    turn_rps = np.array([each.turn_rate_max_rps for each in models_by_index(scenario)[first:]])
    start = scenario.leader_path.at(0.0)
    return HoldingPatternFence(sides, start, Flyers(forward_m, right_m, turn_rps, scenario.formation.slots_turn))


def hold_turn_rps(scenario: Scenario) -> float:
    """Return the rate of the leader's turns before its path: the fastest in which all slots keep up, either way."""
    speed = scenario.path.begin_mps
    models = models_by_index(scenario)[1:]
    max_rps = HOLD_TURN_SHARE * min(each.turn_rate_max_rps for each in models_by_index(scenario))
    turn_rps = np.geomspace(min(GENTLEST_RPS, max_rps), max_rps, 200)
    still, slots = np.zeros_like(turn_rps), SlotMotion.at_rest(slot_table(scenario))
    share = np.array([HOLD_SHARE if each.airframe is None else ENERGY_HOLD_SHARE for each in models])
    low, high = np.array([each.soon_mps(speed) for each in models]).reshape(-1, 2).T
    kept = np.ones_like(turn_rps, dtype=np.bool_)
    for sign in (1.0, -1.0):
        needs = slot_needs(LeaderFlight(speed, sign * turn_rps, still, still, still), slots, scenario.formation.frame)
        fast = needs.speed_mps - speed > share * (high - speed)
        slow = speed - needs.speed_mps > share * (speed - low)
        kept &= ~(fast | slow | (np.abs(needs.relative_heading_rad) > SWING_RAD)).any(axis=1)
    return float(turn_rps[max(int(np.argmin(np.append(kept, False))) - 1, 0)])
