"""The formation law for one follower that hovers: (13) and (14) with velocities in the place of speed and heading.

A multirotor flies the velocity over ground that it is told, in any direction and down to 0, so forward and right are
two channels of one kind: both have the gains of `law.speed`, and neither is divided by a speed. Slots lie in the
leader's frame, which keeps its direction where the leader stands. A commanded velocity is told as a speed and a course.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import within
from flight_model.slot import Triple
from gcs_formation.control.follower import BRAKING_SHARE, Controller, Pair
from gcs_formation.control.setpoint import error_rate, formation_error, lead_height

STANDS_MPS: Final = 0.02
"""Commanded speed below which no direction is taken from it."""
LEAST_CORRECTION_MPS: Final = 0.5
"""Corrections up to this are never limited by that."""


class VelocityController(Controller):
    """The law of a follower that flies by its velocity."""

    def decide(self, pair: Pair, dt_s: float) -> None:
        """Compute the setpoint of this tick, which is `dt_s` after the last one."""
        leader, state, mixer, axis_rad = pair.leader, pair.state, self._parameters.mixer, pair.leader.state.heading_rad
        self.error_m = formation_error(leader.state, state, pair.slot, axis_rad)
        x_mps, y_mps, z_mps = error_rate(leader.state, state, self.error_m, pair.slot, axis_rad, leader.turn_rps)
        self.mixed = mixer.k_x * self.error_m[0], mixer.k_x * self.error_m[1], mixer.k_z * self.error_m[2]
        slopes = mixer.k_x * x_mps, mixer.k_x * y_mps, mixer.k_z * z_mps
        output = self._output(slopes, 1.0, pair, dt_s)
        along_mps, across_mps, height_m = self._limited(pair, feed_forward(pair), output, dt_s)
        speed_mps = math.hypot(along_mps, across_mps)
        aside_rad = math.atan2(across_mps, along_mps) if speed_mps > STANDS_MPS else 0.0
        self.setpoint = speed_mps, axis_rad + aside_rad, height_m

    def _limited(self, pair: Pair, forward: Triple, output: Triple, dt_s: float) -> Triple:
        """Return velocities and height within the limits, and have the controllers integrate what is left.

        A correction is no faster than a vehicle can brake from until it is in its slot.
        """
        model, mixed = pair.model, self.mixed
        away_m = math.hypot(self.error_m[0], self.error_m[1])
        most_mps = LEAST_CORRECTION_MPS + math.sqrt(2.0 * BRAKING_SHARE * model.accel_max_mps2 * away_m)
        share = _share(output[0], output[1], most_mps)
        along_mps, across_mps = forward[0] + share * output[0], forward[1] + share * output[1]
        share = _share(along_mps, across_mps, model.speed_max_mps)
        along_mps, across_mps = share * along_mps, share * across_mps
        reach_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
        height_m = within(forward[2] + output[2], pair.state.height_m - reach_m, pair.state.height_m + reach_m)
        if not (pair.replaced[0] or pair.replaced[1]):
            self._forward.integrate(mixed[0], along_mps - forward[0] - output[0], dt_s)
            self._right.integrate(mixed[1], across_mps - forward[1] - output[1], dt_s)
        if not pair.replaced[2]:
            self._height.integrate(mixed[2], height_m - forward[2] - output[2], dt_s)
        return along_mps, across_mps, height_m


def feed_forward(pair: Pair) -> Triple:
    """Return what holds the slot without any error: velocities along and across the leader's heading, and height.

    They are the velocity of a point of the leader's turning frame, led by its acceleration over the vehicle's lags of
    speed and of course.
    """
    leader, slot, model = pair.leader, pair.slot, pair.model
    turn_rps, bend_rps2, speed_mps = leader.turn_rps, leader.bend_rps2, leader.state.airspeed_mps
    along_mps = speed_mps - turn_rps * slot.right_m + slot.forward_mps
    across_mps = turn_rps * slot.forward_m + slot.right_mps
    along_mps2 = leader.acceleration_mps2 - bend_rps2 * slot.right_m - turn_rps * turn_rps * slot.forward_m
    along_mps2 += slot.forward_mps2 - 2.0 * turn_rps * slot.right_mps
    across_mps2 = speed_mps * turn_rps + bend_rps2 * slot.forward_m - turn_rps * turn_rps * slot.right_m
    across_mps2 += slot.right_mps2 + 2.0 * turn_rps * slot.forward_mps
    height_m = lead_height(leader, slot, model, pair.state.updraught_mps)
    return along_mps + model.tau_v_s * along_mps2, across_mps + model.tau_psi_s * across_mps2, height_m


def _share(along: float, across: float, most: float) -> float:
    """Return to which share a vector is shortened that may be no longer than `most`."""
    length = math.hypot(along, across)
    return 1.0 if length <= most else most / length
