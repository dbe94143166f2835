"""Formation errors and the linear mixer (13), in either slot frame.

Signs: actual minus commanded, leader minus follower (errata items 14 and 25). Slots are forward, right and up of the
leader, that is (-x_rc, -y_rc, -z_rc).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flight_model.arrays import Array, wrap
from formation_scenario.formation import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.estimation.flight_state import FlightStates

TOW_S = 1.36
"""Least time behind the leader that the heading's gains are for in the follower's own frame: 30 m at 22 m/s."""


@dataclass(frozen=True, slots=True)
class Mixer:
    """Coefficients of (13)."""

    k_v: float
    k_x: float
    k_psi: float
    k_y: float
    k_z: float


@dataclass(frozen=True)
class Target:
    """The air-relative motion that keeps a follower in its slot, (F,) each, without error in a steady turn."""

    speed_mps: Array
    heading_rad: Array


def formation_error(leader: FlightStates, follower: FlightStates, slots_m: Array, frame: Frame) -> Array:
    """Return (F, 3): x_c - x_rc, y_c - y_rc, z_c - z_rc in m; positive when the follower is behind, left, below.

    Args:
        leader: the leader's state, a column for each follower.
        follower: the followers' states at the same instants.
        slots_m: (F, 3) forward, right, up of the leader.
        frame: whose heading x and y lie along.
    """
    axis = slot_axis(leader, follower, frame)
    forward_m, right_m = rotate_to(axis, leader.north_m - follower.north_m, leader.east_m - follower.east_m)
    return np.array((forward_m, right_m, leader.height_m - follower.height_m)).T + slots_m


def error_rate(
    leader: FlightStates, follower: FlightStates, error_m: Array, slots: SlotMotion, axis_turn_rps: Array, frame: Frame
) -> Array:
    """Return (F, 3), the rates of change of `formation_error` in m/s: (8), from velocities over ground.

    Args:
        leader: the leader's state, a column for each follower.
        follower: the followers' states at the same instants.
        error_m: (F, 3) the errors themselves.
        slots: of the followers.
        axis_turn_rps: (F,) how the axes turn along which x and y lie.
        frame: whose heading that is.
    """
    ahead_mps = leader.ground_mps - follower.ground_mps
    forward_mps, right_mps = rotate_to(slot_axis(leader, follower, frame), *ahead_mps)
    apart_m, climb_mps = error_m - slots.position_m, leader.climb_mps - follower.climb_mps
    swung = forward_mps + axis_turn_rps * apart_m[:, 1], right_mps - axis_turn_rps * apart_m[:, 0]
    return np.array((*swung, climb_mps)).T + slots.velocity_mps


def slot_target(
    leader: FlightStates, follower: FlightStates, turn_rate_rps: Array, slots: SlotMotion, frame: Frame
) -> Target:
    """Return the airspeed and heading at which the slot stays occupied while its axes turn at `turn_rate_rps`.

    It allows for the difference between the two vehicles' drift (D of (8), errata item 16), and for a slot that is
    moving to another place. Source: (8) with x_c' and y_c' as commanded, solved for the follower's speed and heading.
    """
    x_rc, y_rc = -slots.position_m[:, 0], -slots.position_m[:, 1]
    speed, turn = leader.airspeed_mps, turn_rate_rps
    forth, aside = slots.velocity_mps[:, 0], slots.velocity_mps[:, 1]
    drift_x, drift_y = rotate_to(slot_axis(leader, follower, frame), *drift(leader, follower))
    if frame == "leader_heading":
        forward, right = speed + turn * y_rc - drift_x + forth, -turn * x_rc - drift_y + aside
        return Target(np.hypot(forward, right), leader.heading_rad + np.arctan2(right, forward))
    lead_angle = np.arcsin(np.clip((turn * x_rc + drift_y - aside) / speed, -1.0, 1.0))
    return Target(speed * np.cos(lead_angle) + turn * y_rc - drift_x + forth, leader.heading_rad - lead_angle)


def mix(mixer: Mixer, target: Target, follower: FlightStates, error_m: Array) -> Array:
    """Return (F, 3): e_v in m/s, e_psi in rad and e_z in m of (13), v1 and psi1 replaced by the slot's target."""
    speed = mixer.k_v * (target.speed_mps - follower.airspeed_mps) + mixer.k_x * error_m[:, 0]
    heading = mixer.k_psi * wrap(target.heading_rad - follower.heading_rad) + mixer.k_y * error_m[:, 1]
    return np.array((speed, heading, mixer.k_z * error_m[:, 2])).T


def slot_axis(leader: FlightStates, follower: FlightStates, frame: Frame) -> Array:
    """Return the heading along which the slots' x axes lie, (F,)."""
    return leader.heading_rad if frame == "leader_heading" else follower.heading_rad


def drift(leader: FlightStates, follower: FlightStates) -> Array:
    """Return (2, F) north and east: the follower's drift minus the leader's, in m/s (errata item 16)."""
    return follower.wind_mps - leader.wind_mps


def rotate_to(heading_rad: Array, north: Array, east: Array) -> tuple[Array, Array]:
    """Return the forward and right components of a horizontal vector, for axes that point along `heading_rad`."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return north * cos + east * sin, east * cos - north * sin
