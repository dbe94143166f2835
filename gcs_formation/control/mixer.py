"""Formation errors of one follower and the linear mixer (13), in either slot frame.

Signs: actual minus commanded, leader minus follower (errata items 14 and 25). Slots are forward, right and up of the
leader, that is (-x_rc, -y_rc, -z_rc).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mypy_extensions import mypyc_attr

from flight_model.autopilot import FlightState, rotated, within, wrap
from flight_model.slot import Slot, Triple
from formation_scenario.formation import Frame

TRAIL_S: Final = 1.36
"""Least time behind the leader that the heading's gains are for in the follower's own frame: 30 m at 22 m/s."""
asin: Final = math.asin
atan2: Final = math.atan2
hypot: Final = math.hypot


@dataclass(frozen=True)
class Mixer:
    """Coefficients of (13)."""

    k_v: float
    k_x: float
    k_psi: float
    k_y: float
    k_z: float


@mypyc_attr(acyclic=True, free_list_len=1)
class Target:
    """The air-relative motion that keeps a follower in its slot without error in a steady turn."""

    __slots__ = ("heading_rad", "speed_mps")

    def __init__(self, speed_mps: float, heading_rad: float) -> None:
        """Take airspeed and heading."""
        self.speed_mps = speed_mps
        self.heading_rad = heading_rad


def formation_error(leader: FlightState, follower: FlightState, slot: Slot, axis_rad: float) -> Triple:
    """Return x_c - x_rc, y_c - y_rc, z_c - z_rc in m; positive when the follower is behind, left, below.

    Both states are of one instant; x and y lie along and across `axis_rad`.
    """
    north_m, east_m = leader.north_m - follower.north_m, leader.east_m - follower.east_m
    x_m, y_m = rotated(axis_rad, north_m, east_m)
    return x_m + slot.forward_m, y_m + slot.right_m, leader.height_m - follower.height_m + slot.up_m


def error_rate(
    leader: FlightState, follower: FlightState, error_m: Triple, slot: Slot, axis_rad: float, axis_turn_rps: float
) -> Triple:
    """Return how fast `formation_error` changes, m/s: (8), from velocities over ground, while its axes turn."""
    leader_north_mps, leader_east_mps = leader.ground_mps()
    north_mps, east_mps = follower.ground_mps()
    x_mps, y_mps = rotated(axis_rad, leader_north_mps - north_mps, leader_east_mps - east_mps)
    return (
        x_mps + axis_turn_rps * (error_m[1] - slot.right_m) + slot.forward_mps,
        y_mps - axis_turn_rps * (error_m[0] - slot.forward_m) + slot.right_mps,
        leader.climb_mps - follower.climb_mps + slot.up_mps,
    )


def slot_target(
    leader: FlightState, drift_x_mps: float, drift_y_mps: float, turn_rps: float, slot: Slot, frame: Frame
) -> Target:
    """Return the airspeed and heading at which the slot stays occupied while its axes turn at `turn_rps`.

    It allows for the drift D of (8) along and across the axes, and for a slot that is moving to another place. Source:
    (8) with x_c' and y_c' as commanded, solved for the follower's speed and heading.
    """
    v1, x_rc, y_rc = leader.airspeed_mps, -slot.forward_m, -slot.right_m
    if frame == "leader_heading":
        forward_mps = v1 + turn_rps * y_rc - drift_x_mps + slot.forward_mps
        right_mps = -turn_rps * x_rc - drift_y_mps + slot.right_mps
        return Target(hypot(forward_mps, right_mps), leader.heading_rad + atan2(right_mps, forward_mps))
    off_rad = asin(within((turn_rps * x_rc + drift_y_mps - slot.right_mps) / v1, -1.0, 1.0))
    speed_mps = v1 * math.cos(off_rad) + turn_rps * y_rc - drift_x_mps + slot.forward_mps
    return Target(speed_mps, leader.heading_rad - off_rad)


def mix(mixer: Mixer, target: Target, follower: FlightState, error_m: Triple) -> Triple:
    """Return e_v in m/s, e_psi in rad and e_z in m of (13), v1 and psi1 replaced by the slot's target."""
    return (
        mixer.k_v * (target.speed_mps - follower.airspeed_mps) + mixer.k_x * error_m[0],
        mixer.k_psi * wrap(target.heading_rad - follower.heading_rad) + mixer.k_y * error_m[1],
        mixer.k_z * error_m[2],
    )
