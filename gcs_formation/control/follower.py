"""The formation law for one follower: mixer (13), fuzzy scheduler and PID (14), envelope.

The equations are the corrected ones: integrators start at trim, the leader's motion is fed forward, and the mixed
errors refer to the slot's own speed and heading.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import AutopilotModel, rate, rotated, within, wrap
from flight_model.slot import Slot, Vector3, all_finite
from gcs_formation.control.follower_loops import Controller, LawInput, LawParameters
from gcs_formation.control.setpoint import (
    TRAIL_S,
    Envelope,
    Target,
    TrailingSlot,
    error_rate,
    feed_forward,
    formation_error,
    lead_velocity,
    mix,
    slot_target,
)

GUST_SIGMAS: Final = 3.0
"""Changes of the wind estimate within this many standard deviations aren't fed forward. Tuned: standard deviations; 2
to 4; shown by `python -m benchmarks.effort_grid`."""
SWING_S: Final = 0.6
"""Lateral offset, divided by airspeed, at which the heading loop has half its bandwidth in the follower's own frame.
Tuned: s; 0.3 to 1.2; shown by `python -m benchmarks.gust_swing`."""
BRAKING_SHARE: Final = 0.5
"""Share of the acceleration limit that is planned for slowing down to the slot's speed. Tuned: share; 0.3 to 0.8; shown
by `pytest tests/gcs_formation/control`."""
MIN_CLOSING_MPS: Final = 1.0
"""Closing speed that is allowed at any distance. Tuned: m/s; 0.5 to 2; shown by `pytest
tests/gcs_formation/control`."""
FAR_M: Final = 10.0
"""A vehicle with a larger forward error, closing or overshooting faster than `SLOW_MPS`, is arriving at its slot.
Tuned: m; 5 to 20; shown by `pytest tests/gcs_formation/control`."""
SLOW_MPS: Final = 0.5
"""Closing speed from which on a far vehicle is arriving, and below which it isn't any more. Tuned: m/s; 0.3 to 1; shown
by `pytest tests/gcs_formation/control`."""
SETTLES_S: Final = 5.0
"""The arrival ends once the vehicle has been slower for so long; until then the speed integral may only shrink. Tuned:
s; 3 to 10; shown by `pytest tests/gcs_formation/control`."""


def swing_share(right_m: float, airspeed_mps: float) -> float:
    """Return the heading loop's share of its design bandwidth in the follower's own frame, for a slot at the side."""
    return SWING_S / (SWING_S + min(abs(right_m) / airspeed_mps, TRAIL_S))


class FollowerController(Controller):
    """The law of a follower that is commanded by speed and heading."""

    def __init__(self, parameters: LawParameters) -> None:
        """Start with empty integrators and filters."""
        super().__init__(parameters)
        self._trailing = TrailingSlot() if parameters.frame == "follower_heading" else None
        self._drift_north_mps = self._drift_east_mps = math.nan
        self._share, self._share_for = 0.0, (0.0, 0.0)
        """Gain of the drift's filter for one tick, and the bandwidth and tick length it was computed for."""
        self._correction: tuple[float, float] = (math.nan, math.nan)
        self._wanted: tuple[float, float] = (math.nan, math.nan)
        """Rates of the target's speed and heading, m/s² and rad/s, over the tick that ends; NaN at first."""
        self._arriving, self._slow_s = False, 0.0

    def reset(self) -> None:
        """Reset: the follower isn't commanded, or follows another leader."""
        super().reset()
        if self._trailing is not None:
            self._trailing.reset()
        self._drift_north_mps = self._drift_east_mps = math.nan
        self._correction = self._wanted = (math.nan, math.nan)
        self._arriving = False

    def decide(self, pair: LawInput, dt_s: float) -> None:
        """Compute the setpoint of this tick, which is `dt_s` after the last one."""
        leader, state, slot, model = pair.leader, pair.state, pair.slot, pair.model
        axis_rad, turn_rps, bend_rps2 = leader.state.heading_rad, leader.turn_rps, leader.bend_rps2
        if self._trailing is not None:
            axis_rad = state.heading_rad
            turn_rps, bend_rps2 = self._trailing.turning(leader, slot, dt_s)
        self.error_m = formation_error(leader.state, state, slot, axis_rad)
        along_mps2, across_mps2 = self._gust(pair, axis_rad, dt_s)
        begun_rps = turn_rps - leader.half_s * bend_rps2
        target, led_mps, led_rad = self._target(pair, axis_rad, begun_rps, across_mps2, dt_s)
        self.mixed = mix(self._parameters.mixer, target, state, self._errors_to_mix(pair, target))
        slot_axis_rad = leader.state.heading_rad if self._trailing is None else target.heading_rad
        speed_mps, heading_rad, height_m = feed_forward(
            target, leader, slot_axis_rad, turn_rps, bend_rps2, slot, model, state.updraught_mps
        )
        forward = (speed_mps + led_mps, heading_rad + led_rad, height_m)
        slopes = self._slopes(pair, axis_rad, target, forward, dt_s)
        output = self._output(slopes, self._heading_bandwidth(pair), pair, dt_s)
        against_gust = lead_velocity(target, slot_axis_rad, -along_mps2, -across_mps2, model)
        self.setpoint = self._limited(pair, target, forward, output, against_gust, dt_s)

    def _target(
        self, pair: LawInput, axis_rad: float, turn_rps: float, across_mps2: float, dt_s: float
    ) -> tuple[Target, float, float]:
        """Return the slot's target, and the leads of speed and heading beyond the feed-forward.

        In the follower's own frame, the heading crabs slowly against a gust across the axes. That swings a slot at the
        side forward or back, so speed is led by the swing.
        """
        leader, state, slot, frame = pair.leader.state, pair.state, pair.slot, self._parameters.frame
        drift_north_mps = state.wind_north_mps - leader.wind_north_mps
        drift_east_mps = state.wind_east_mps - leader.wind_east_mps
        along_mps, drift_mps = rotated(axis_rad, drift_north_mps, drift_east_mps)
        if self._trailing is None:
            return slot_target(leader, along_mps, drift_mps, turn_rps, slot, frame), 0.0, 0.0
        _, late_mps = rotated(axis_rad, self._drift_north_mps, self._drift_east_mps)
        crab_rad, crab_rps, crab_rps2 = self._trailing.crab(late_mps, across_mps2, leader.airspeed_mps, dt_s)
        target = slot_target(leader, along_mps, -leader.airspeed_mps * crab_rad, turn_rps, slot, frame)
        target.speed_mps -= slot.right_m * crab_rps
        return target, -pair.model.tau_v_s * slot.right_m * crab_rps2, pair.model.tau_psi_s * crab_rps

    def _errors_to_mix(self, pair: LawInput, target: Target) -> Vector3:
        """Return the errors that enter the mixer: `error_m`, corrected for the heading in the follower's own frame.

        While the follower's heading differs from its slot's by some angle, the follower's frame swings a slot at the
        side forward by y_rc times the angle. This error is removed: speed can't follow it, and it vanishes as the
        heading returns. A slot behind swings sideways by x_rc times the angle, which adds damping; a slot less than
        `TRAIL_S` behind is given the missing damping.
        """
        x_m, y_m, z_m = self.error_m
        if self._trailing is None:
            return self.error_m
        off = math.sin(wrap(pair.state.heading_rad - target.heading_rad))
        return x_m + pair.slot.right_m * off, y_m - _missing_trail_m(target, pair.slot) * off, z_m

    def _slopes(self, pair: LawInput, axis_rad: float, target: Target, forward: Vector3, dt_s: float) -> Vector3:
        """Return the rates of change of the mixed errors, from the states and not from earlier errors.

        The rates of the follower and of its target are means over the tick that ends: a leader whose turn rate begins
        to change in this tick is followed by the feed-forward, and shows no error yet. The target's are those that the
        feed-forward led it by. The follower's own follow from the errors left at the tick's end: (7) gives them with
        `held` time constants shortened by a tick. Positions change by the velocities at the tick's end.
        """
        model, state, slot = pair.model, pair.state, pair.slot
        speed_mps, heading_rad = pair.commanded[0], pair.commanded[1]
        own_mps2 = rate(speed_mps - state.airspeed_mps, model.tau_v_s - dt_s, model.accel_max_mps2)
        own_rps = rate(wrap(heading_rad - state.heading_rad), model.tau_psi_s - dt_s, model.turn_rate_max_rps)
        wanted_mps2, wanted_rps = self._wanted_before(
            (forward[0] - target.speed_mps) / model.tau_v_s, (forward[1] - target.heading_rad) / model.tau_psi_s
        )
        axis_turn_rps = pair.leader.begun_rps if self._trailing is None else own_rps
        x_mps, y_mps, z_mps = error_rate(pair.leader.state, state, self.error_m, slot, axis_rad, axis_turn_rps)
        if self._trailing is not None:
            off_rad = wrap(state.heading_rad - target.heading_rad)
            swing_rps = (own_rps - wanted_rps) * math.cos(off_rad)
            x_mps += slot.right_m * swing_rps + slot.right_mps * math.sin(off_rad)
            y_mps -= _missing_trail_m(target, slot) * swing_rps
        mixer = self._parameters.mixer
        return (
            mixer.k_v * (wanted_mps2 - own_mps2) + mixer.k_x * x_mps,
            mixer.k_psi * (wanted_rps - own_rps) + mixer.k_y * y_mps,
            mixer.k_z * z_mps,
        )

    def _wanted_before(self, mps2: float, rps: float) -> tuple[float, float]:
        """Return the target's rates over the tick that ends, and keep those over the tick that begins."""
        before, self._wanted = self._wanted, (mps2, rps)
        return self._wanted if math.isnan(before[0]) else before

    def _heading_bandwidth(self, pair: LawInput) -> float:
        """Return the heading loop's share of its design bandwidth: less for a slot at the side.

        In the follower's own frame a turn swings such a slot forward at y_rc times the turn rate. The speed loop has
        to match that, and is far slower than the heading loop.
        """
        return 1.0 if self._trailing is None else swing_share(pair.slot.right_m, pair.leader.state.airspeed_mps)

    def _limited(
        self, pair: LawInput, target: Target, forward: Vector3, output: Vector3, gust: tuple[float, float], dt_s: float
    ) -> Vector3:
        """Return the setpoint within the envelope, and update the integrators by what was limited.

        Corrections of the feed-forward grow no faster than the vehicle can follow, but may shrink at any rate, or the
        loop would lag in large manoeuvres. Heights are limited by the envelope alone. `gust`, the lead of speed and
        heading against a gust, acts at once and extends the growth limit. In the follower's own frame, where headings
        crab slowly, only its speed is used.
        """
        model, replaced, slew = pair.model, pair.replaced, self._parameters.slew
        bounds = Envelope(forward[1], pair.state, model)
        # The lead against a gust is inside the envelope too: it would otherwise undo a correction at the limit.
        led_mps, led_rad = forward[0] + gust[0], forward[1] + (gust[1] if self._trailing is None else 0.0)
        wanted = bounds.limit(led_mps + output[0], led_rad + output[1], forward[2] + output[2])
        if not all_finite(wanted):
            return wanted
        before_mps, before_rad = self._correction
        max_mps = slew[0] * dt_s * model.accel_max_mps2 + abs(gust[0])
        max_rad = slew[1] * dt_s * model.turn_rate_max_rps + abs(gust[1])
        # Growth isn't limited from a setpoint that the separation rule replaced.
        closing_mps = self._closing(wanted[0] - led_mps, pair.state.airspeed_mps - target.speed_mps, model)
        faster_mps = _limit_growth(closing_mps, math.nan if replaced[0] else before_mps, max_mps)
        turned_rad = _limit_growth(wanted[1] - led_rad, math.nan if replaced[1] else before_rad, max_rad)
        self._correction = (faster_mps, turned_rad)
        limited = bounds.limit(led_mps + faster_mps, led_rad + turned_rad, wanted[2])
        # What the feed-forward alone exceeds the envelope by doesn't count as excess of the integrators.
        free = bounds.limit(led_mps, led_rad, forward[2])
        if self.feedback is not None:
            self.feedback.limited(
                (limited[0] - free[0] - output[0], limited[1] - free[1] - output[1], limited[2] - free[2] - output[2])
            )
            return limited
        arrives = self._arrives(pair.state.airspeed_mps - target.speed_mps, dt_s)
        if not replaced[0]:
            max_mps = model.speed_max_mps - model.speed_min_mps
            self._forward.integrate(self.mixed[0], limited[0] - free[0] - output[0], dt_s, max_mps, grows=not arrives)
        if not replaced[1]:
            self._right.integrate(self.mixed[1], limited[1] - free[1] - output[1], dt_s)
        if not replaced[2] and not self._closes_fast(model):
            self._height.integrate(self.mixed[2], limited[2] - free[2] - output[2], dt_s)
        return limited

    def _arrives(self, flown_mps: float, dt_s: float) -> bool:
        """Return whether it is arriving at its slot, flying `flown_mps` faster than the slot.

        An integral accumulated during the arrival would only be lost again by overshooting. A vehicle that stays far
        off at its slot's speed isn't arriving: it doesn't fly its speed setpoint, and that error is integrated.
        """
        fast = abs(flown_mps) > SLOW_MPS
        self._arriving = self._arriving or (fast and abs(self.error_m[0]) > FAR_M)
        self._slow_s = 0.0 if fast else self._slow_s + dt_s
        self._arriving = self._arriving and self._slow_s < SETTLES_S
        return self._arriving

    def _closing(self, faster_mps: float, flown_mps: float, model: AutopilotModel) -> float:
        """Return the speed correction `faster_mps`, limited so that the vehicle can brake before it reaches its slot.

        `flown_mps`: how much faster than its slot it flies now.
        """
        error_m = self.error_m[0]
        max_mps = MIN_CLOSING_MPS + math.sqrt(2.0 * BRAKING_SHARE * model.accel_max_mps2 * abs(error_m))
        if error_m > 0.0:
            return min(faster_mps, max_mps + max(max_mps - flown_mps, 0.0))
        return max(faster_mps, -max_mps - max(max_mps + flown_mps, 0.0))

    def _gust(self, pair: LawInput, axis_rad: float, dt_s: float) -> tuple[float, float]:
        """Return the rate of change of the filtered drift (follower's wind minus leader's), along and across, m/s².

        The filter's time constant is 1/`gust_radps`. The part of the rate that the wind's variance explains is left
        out.
        """
        leader, state, gust_radps = pair.leader.state, pair.state, self._parameters.gust_radps
        north_mps = state.wind_north_mps - leader.wind_north_mps
        east_mps = state.wind_east_mps - leader.wind_east_mps
        if math.isnan(self._drift_north_mps):
            self._drift_north_mps, self._drift_east_mps = north_mps, east_mps
        north_mps -= self._drift_north_mps
        east_mps -= self._drift_east_mps
        if self._share_for != (gust_radps, dt_s):
            self._share, self._share_for = 1.0 - math.exp(-gust_radps * dt_s), (gust_radps, dt_s)
        self._drift_north_mps += self._share * north_mps
        self._drift_east_mps += self._share * east_mps
        size = max(north_mps * north_mps + east_mps * east_mps, 1e-12)
        certain = max(1.0 - GUST_SIGMAS * GUST_SIGMAS * pair.wind_variance / size, 0.0) * gust_radps
        return rotated(axis_rad, certain * north_mps, certain * east_mps)


def _missing_trail_m(target: Target, slot: Slot) -> float:
    """Return how much less far behind a slot is than the distance that the heading gains are designed for."""
    return max(TRAIL_S * target.speed_mps + slot.forward_m, 0.0)


def _limit_growth(wanted: float, before: float, maximum: float) -> float:
    """Return the correction `wanted`, grown by at most `maximum` from the one `before`; NaN: no previous correction."""
    if math.isnan(before):
        return wanted
    return within(wanted, min(before, 0.0) - maximum, max(before, 0.0) + maximum)
