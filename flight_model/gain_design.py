"""Gains of the formation law by loop shaping on the autopilot's frequency response.

Each channel's controller is kp + ki/s + kd s with two free numbers: its bandwidth, and the share of the autopilot's
phase delay that the derivative compensates. The fastest loop is chosen that keeps the bounds below: with the known
response, those of the sensitivity peak and the delay margin; with responses that are slower or faster and stronger or
weaker, a sensitivity peak of its own; and those of the setpoint steps that telemetry noise causes (the law takes error
rates from velocities, not from differences of positions). All of the delay counts as uncompensated. The wind observer
closes another loop around the airspeed: deviations of an aircraft from its model look like wind and are then
compensated. Its bandwidth is the largest that leaves the airspeed loop enough delay margin. Source: S. Skogestad and I.
Postlethwaite, "Multivariable Feedback Control", 2nd ed., 2.4 and 2.6; K. J. Astrom and T. Hagglund, "Advanced PID
Control", 4.5.

The consensus protocol (3) is designed likewise. A graph's mode of eigenvalue lambda closes the loop tau (lambda (k1/s +
k2) + k3 - 1/tau) P(s), along the heading and across it: P is the aircraft's response to its setpoint, and tau the time
constant of model (7) that converts (3) into setpoints. The common motion is the mode of eigenvalue 0. Under
total-energy control, airspeed responds to quick changes of its setpoint with several times their size, so velocities
can't be fed back along the heading: k2 is 0, and k3 is 1/tau_v, the damping that airspeed has by itself. Across the
heading, where time constants are longer, this k3 adds damping. k1 is the largest at which every mode keeps the bounds.
Peaks assume states predicted over the links' delay; for the delay margin all of the delay counts as uncompensated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from flight_model.arrays import Array, Complex
from flight_model.frequency_response import (
    FREQUENCIES,
    Responses,
    delay_margin_s,
    delay_response,
    mismatched,
    sensitivity_peak,
    stable_delay_s,
)
from flight_model.slot import Vector3

BANDWIDTHS = np.geomspace(1.5, 0.03, 60)
"""Bandwidths that are tried, rad/s, the fastest first."""
TAU_SHARES = (1.0, 0.5, 0.0)
"""Shares of the phase delay that the derivative (for heights, the proportional gain) may compensate."""
INTEGRAL_SHARE = 0.125
"""Corner frequency of the integral, as a share of the bandwidth."""
PEAK = 1.6
"""Largest sensitivity with the known response."""
MISMATCH_PEAK = 2.5
"""Largest sensitivity with a mismatched response."""
DELAY_MARGIN_S = 1.0
"""Least delay margin of a loop with the known response."""
STEPS = (0.03, 0.006, 0.03)
"""Largest standard deviations of a tick's setpoint steps from noise: m/s, rad, m."""
UNMODELLED: Final[tuple[float, float, float]] = (0.05, 0.05, 0.003)
"""Random walks of climb, airspeed (m/s) and heading (rad) beside model (7), per square root of a second."""
WIND_WALK: Final = 0.02
"""The same for the wind without gusts, m/s."""
SAMPLES = 400
"""Samples after which the filter's gain is taken as steady, and its response to one sample as over."""
SEEN = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, 0.0)))
"""Derivatives of position, velocity over ground and airspeed by the states: position, airspeed and wind."""
PAIR = math.sqrt(2.0)
"""Noise of a difference of two vehicles, relative to one's."""
DERIVATIVE_FILTER_S = 0.3
OBSERVERS_RADPS = np.geomspace(2.0, 0.01, 60)
"""Bandwidths of the wind observer that are tried, the fastest first."""
OBSERVED_SHARE = 0.85
"""Share of the airspeed loop's delay margin that must remain with the observer."""
UNKNOWN_DELAY_S = 0.6
"""Delay beyond the links' configured one with which that must hold: 300 ms in each direction."""
Weights = Mapping[str, float]
"""k_x, k_psi, k_y and k_z of the mixer, which the design takes as given."""
Gains = tuple[float, float, float]
"""kp, ki and kd."""
Filters = tuple[float, float, float]
"""Time constant of the derivative, s, bandwidth of the wind observer, rad/s, and time constant of the anti-windup, s:
the longest integral time, limited to what an overshoot may last."""


class DelayAndNoise(NamedTuple):
    """Delay and noise that a design is for; standard deviations are of white noise."""

    law_dt_s: float
    delay_s: float
    """Loop delay: both directions, sampling and hold."""
    position_m: float
    airspeed_mps: float
    heading_rad: float


@dataclass(frozen=True)
class DesignedChannel:
    """One channel's gains, and the margins of its loop."""

    kp: float
    ki: float
    kd: float
    bandwidth_radps: float
    """Crossover of the loop; for heights, that of the integral."""
    delay_margin_s: float
    peak: float
    mismatch_peak: float
    step_sigma: float
    """Standard deviation of a tick's setpoint step from telemetry noise, m/s, rad or m."""


def design(
    vehicles: Sequence[Responses], speed_mps: float, weights: Weights, telemetry: DelayAndNoise
) -> tuple[dict[str, DesignedChannel], Filters]:
    """Return gains that keep the bounds with every vehicle, by channel, and the law's filters.

    Args:
        vehicles: responses at `FREQUENCIES` of each type of vehicle.
        speed_mps: along the path.
        weights: of the mixed errors.
        telemetry: delay and noise.
    """
    loops = _loops(vehicles, speed_mps, weights, telemetry)
    channels = {
        name: _channel(each, telemetry, maximum) for (name, each), maximum in zip(loops.items(), STEPS, strict=True)
    }
    speed, tried = channels["speed"], OBSERVERS_RADPS.tolist()
    good = (r for r in tried if all(_observer_leaves_margin(r, each, speed, weights, telemetry) for each in vehicles))
    integral_s = max(each.kp / each.ki for each in channels.values() if each.ki > 0)
    anti_windup_s = float(np.clip(integral_s, 1.0, 20.0))
    return channels, (DERIVATIVE_FILTER_S, next(good, float(OBSERVERS_RADPS[-1])), anti_windup_s)


def judged_channels(
    gains: Mapping[str, Gains],
    vehicles: Sequence[Responses],
    speed_mps: float,
    weights: Weights,
    telemetry: DelayAndNoise,
) -> dict[str, DesignedChannel]:
    """Return the margins of given gains (kp, ki, kd of speed, heading and height); arguments as for `design`."""
    loops = _loops(vehicles, speed_mps, weights, telemetry)
    return {
        name: judged(gains[name], each.bandwidth_radps(gains[name]), each, telemetry) for name, each in loops.items()
    }


def _loops(
    vehicles: Sequence[Responses], speed_mps: float, weights: Weights, telemetry: DelayAndNoise
) -> dict[str, _Loops]:
    s, late_s = 1j * FREQUENCIES, telemetry.delay_s
    position_m, along_mps, heading_rad = (PAIR * each for each in telemetry[2:])
    across_mps = speed_mps * heading_rad
    along_m, across_m = math.hypot(position_m, late_s * along_mps), math.hypot(position_m, late_s * across_mps)
    forward = [weights["k_x"] * each.speed / s for each in vehicles]
    right = [(weights["k_psi"] + weights["k_y"] * speed_mps / s) * each.heading for each in vehicles]
    up = [weights["k_z"] * each.height for each in vehicles]
    across = math.hypot(weights["k_y"] * across_m, weights["k_psi"] * heading_rad)
    return {
        "speed": _Loops(forward, weights["k_x"], False, weights["k_x"] * along_m, weights["k_x"] * along_mps),
        "heading": _Loops(right, weights["k_y"] * speed_mps, False, across, weights["k_y"] * across_mps),
        "height": _Loops(up, weights["k_z"], True, weights["k_z"] * position_m, 0.0),
    }


class _Loops(NamedTuple):
    """One channel of all vehicles: plants at `FREQUENCIES`, and their approximation at low frequencies."""

    plants: Sequence[Complex]
    slope: float
    """The plant is about slope/s at low frequencies, or slope itself if it is restoring."""
    restoring: bool
    noise: float
    """Noise of the mixed error."""
    rate_noise: float
    """Noise of its rate of change, per second."""

    def bandwidth_radps(self, gains: Gains) -> float:
        """Return the bandwidth that results from gains."""
        return self.slope * (gains[1] if self.restoring else gains[0])

    @property
    def phase_delay_s(self) -> float:
        """The shortest phase delay of the plants at low frequency."""
        w = FREQUENCIES[FREQUENCIES < 0.1]
        turned = (np.unwrap(np.angle(each[: w.size])) + (0.0 if self.restoring else np.pi / 2) for each in self.plants)
        return max(0.0, min(float(np.median(-each / w)) for each in turned))

    def gains(self, bandwidth: float, share: float) -> Gains:
        """Return the gains for a bandwidth and a compensated share of the phase delay."""
        if self.restoring:
            return bandwidth * share * self.phase_delay_s / self.slope, bandwidth / self.slope, 0.0
        kp = bandwidth / self.slope
        return kp, kp * bandwidth * INTEGRAL_SHARE, kp * share * self.phase_delay_s

    def step_sigma(self, gains: Gains, dt_s: float) -> float:
        """Return the standard deviation of the setpoint's steps from tick to tick, for white noise."""
        kp, ki, kd = gains
        kept = math.exp(-dt_s / DERIVATIVE_FILTER_S)
        of_rate = kd * (1.0 - kept) * math.sqrt(2.0 / (1.0 + kept))
        return math.hypot(self.noise * math.hypot(kp + ki * dt_s, kp), self.rate_noise * of_rate)


def _observer_leaves_margin(
    radps: float, vehicle: Responses, channel: DesignedChannel, weights: Weights, telemetry: DelayAndNoise
) -> bool:
    """Return whether a wind observer of this bandwidth leaves the airspeed loop enough of its delay margin.

    The commanded airspeed compensates the estimated wind: ground speed minus modelled airspeed, with a time constant of
    1/`radps`. In the worst case, assumed here, the model explains nothing and the observer's full output is fed back.
    """
    s = 1j * FREQUENCIES
    plant = vehicle.speed * delay_response(telemetry.delay_s + UNKNOWN_DELAY_S)
    position = weights["k_x"] * _controller((channel.kp, channel.ki, channel.kd)) / s
    observed = (position + radps / (s + radps)) * plant
    enough_s = OBSERVED_SHARE * delay_margin_s(position * plant)
    return math.isfinite(sensitivity_peak(observed)) and delay_margin_s(observed) >= enough_s


def _channel(loops: _Loops, telemetry: DelayAndNoise, maximum: float) -> DesignedChannel:
    """Return the fastest channel that keeps the bounds, or the slowest one tried if none does."""
    tried = ((bandwidth, share) for bandwidth in BANDWIDTHS.tolist() for share in TAU_SHARES)
    for bandwidth, share in tried:
        gains = loops.gains(bandwidth, share)
        if loops.step_sigma(gains, telemetry.law_dt_s) > maximum:
            continue
        controller = _controller(gains) * delay_response(telemetry.delay_s)
        if max(sensitivity_peak(controller * plant) for plant in loops.plants) > PEAK:
            continue
        found = judged(gains, bandwidth, loops, telemetry)
        if found.mismatch_peak <= MISMATCH_PEAK and found.delay_margin_s >= DELAY_MARGIN_S:
            return found
    slowest = float(BANDWIDTHS[-1])
    return judged(loops.gains(slowest, 0.0), slowest, loops, telemetry)


def judged(gains: Gains, bandwidth: float, channel: _Loops, telemetry: DelayAndNoise) -> DesignedChannel:
    """Return a channel with these gains, and its margins."""
    controller = _controller(gains) * delay_response(telemetry.delay_s)
    loops = [controller * plant for plant in channel.plants]
    off = [loop for plant in channel.plants for loop in mismatched(controller, plant)]
    return DesignedChannel(
        *gains,
        bandwidth,
        min(delay_margin_s(loop) for loop in loops),
        max(sensitivity_peak(loop) for loop in loops),
        max(sensitivity_peak(loop) for loop in off),
        channel.step_sigma(gains, telemetry.law_dt_s),
    )


def _controller(gains: Gains) -> Complex:
    kp, ki, kd = gains
    s = 1j * FREQUENCIES
    return np.asarray(kp + ki / s + kd * s / (DERIVATIVE_FILTER_S * s + 1.0))


def left_by_filter(
    sample: tuple[float, float, float], walk_mps: float, tau_s: float, period_s: float
) -> tuple[float, float]:
    """Return the noise of position (m) and airspeed (m/s) along one axis that the station's filter leaves.

    The law uses states from a Kalman filter by model (7), which averages noise over many samples, so it changes them
    from tick to tick by a small part of a sample's noise. Returned are the standard deviations of white noise that
    would cause the same changes from sample to sample. Source: Gelb, "Applied Optimal Estimation" (1974), 4.4.

    Args:
        sample: standard deviations of a sample's position (m), velocity over ground and airspeed (m/s), all above 0.
        walk_mps: random walk of the airspeed beside its model, per square root of a second.
        tau_s: the airspeed's time constant.
        period_s: from one sample to the next.
    """
    kept = math.exp(-period_s / tau_s)
    carry = np.array(((1.0, tau_s * (1.0 - kept), period_s), (0.0, kept, 0.0), (0.0, 0.0, 1.0)))
    variances: Array = np.square(sample)
    covariance, gain = np.diag(variances), np.zeros((3, 3))
    for _ in range(SAMPLES):
        covariance = carry @ covariance @ carry.T + period_s * np.diag((0.0, walk_mps**2, WIND_WALK**2))
        gain = np.linalg.solve(SEEN @ covariance @ SEEN.T + np.diag(variances), SEEN @ covariance).T
        covariance -= gain @ SEEN @ covariance
    answer, before, squares = gain, np.zeros((3, 3)), np.zeros((3, 3))
    for _ in range(SAMPLES):
        squares += np.square(answer - before)
        before, answer = answer, carry @ answer - gain @ (SEEN @ (carry @ answer))
    position_m, airspeed_mps, _ = np.sqrt(squares @ variances / 2.0).tolist()
    return position_m, airspeed_mps


class Axis(NamedTuple):
    """One setpoint of a vehicle."""

    tau_s: float
    """Time constant of the vehicle's model (7)."""
    response: Complex
    """Response of the vehicle, at `FREQUENCIES`."""
    steps_mps: float
    """Largest standard deviation of a tick's setpoint step, as a speed."""

    @classmethod
    def along(cls, tau_s: float, response: Complex) -> Axis:
        """Return the axis of the airspeed's setpoint."""
        return cls(tau_s, response, STEPS[0])

    @classmethod
    def across(cls, tau_s: float, response: Complex, speed_mps: float) -> Axis:
        """Return the axis of the heading's setpoint, at an airspeed."""
        return cls(tau_s, response, STEPS[1] * speed_mps)


def consensus_gains(
    vehicles: Sequence[tuple[Axis, Axis]],
    eigenvalues: Sequence[complex],
    position_m: float,
    sampling_s: float,
    links_s: float,
) -> Vector3:
    """Return k1 in 1/s², k2 and k3 in 1/s; k1 is the least one tried if none keeps the bounds.

    Args:
        vehicles: axes, along and across, of each type of vehicle.
        eigenvalues: of the graph's Laplacian.
        position_m: noise of a position, standard deviation.
        sampling_s: the loops' delay from sampling and hold.
        links_s: their delay from the links, both directions.
    """
    modes = sorted({0j, *np.round(np.asarray(eigenvalues, np.complex128), 6).tolist()}, key=abs, reverse=True)
    largest, axes = max(abs(modes[0]), 1.0), [axis for each in vehicles for axis in each]
    quiet = min(axis.steps_mps / axis.tau_s for axis in axes) / (PAIR * position_m)
    dampings = sorted({1.0 / along.tau_s for along, _ in vehicles}, reverse=True)
    tried = [(float(k) / largest, k3) for k in BANDWIDTHS if k <= quiet for k3 in dampings]
    tried.append((float(BANDWIDTHS[-1]) / largest, dampings[0]))
    min_s = DELAY_MARGIN_S + links_s
    loops = [(axis, mode) for mode in modes for axis in axes]
    holds = (gains for gains in tried if all(_holds(*gains, *loop, sampling_s, min_s) for loop in loops))
    k1, k3 = next(holds, tried[-1])
    return k1, 0.0, k3


def _holds(k1: float, k3: float, axis: Axis, mode: complex, sampling_s: float, min_s: float) -> bool:
    """Return whether a mode's loop on an axis keeps the bounds, also around mismatched responses.

    `min_s`: least delay up to which the loop with the known response must be stable.
    """
    s = 1j * FREQUENCIES
    controller = (axis.tau_s * (mode * k1 / s + k3) - 1.0) * delay_response(sampling_s)
    integrators = 1 if mode else 0
    if not _within_bounds(controller * axis.response, integrators, PEAK, min_s):
        return False
    return all(_within_bounds(loop, integrators, MISMATCH_PEAK, 0.0) for loop in mismatched(controller, axis.response))


def _within_bounds(loop: Complex, integrators: int, peak: float, min_s: float) -> bool:
    margin_s = stable_delay_s(loop, integrators)
    return margin_s > 0.0 and margin_s >= min_s and float(np.max(1.0 / np.abs(1.0 + loop))) <= peak
