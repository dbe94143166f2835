"""Frequency responses of autopilots from setpoints to motion, and the margins of loops around them.

Autopilots are those of equation (7), or of an airframe near trim. For a loop: its sensitivity peak, its delay margin,
and the same loop around a mismatched response.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flight_model import energy
from flight_model.arrays import Array, Complex
from flight_model.energy import AirframeParameters

FREQUENCIES = np.geomspace(0.005, 25.0, 400)
"""rad/s."""
MISMATCH = 0.3
"""Relative error of the autopilot's time scale and gain, in all combinations."""
LEAST = 1e-300
"""Least size of a response that has a logarithm: a channel that a limit holds responds by 0."""
ROUNDING = 1e-6
SLOW_RADPS = 0.15
"""Turns and climbs of a formation's path change no faster than this."""
MIN_TAU_S = 0.2
HEIGHT, SPEED, HEADING = (energy.QUANTITIES.index(name) for name in ("height_m", "speed_mps", "heading_rad"))
SMALL = np.array([1e-2, 1e-3, 1e-3, 1e-4])
"""Perturbations of height (m), climb and airspeed (m/s) and heading (rad), far inside every limit."""
INNER = 1e-4
STRAIGHT_RAD = 1.0
"""Limit of bank for straight flight, where it doesn't matter."""


@dataclass(frozen=True)
class Responses:
    """Complex responses of airspeed, heading and height to their own setpoints, at (W,) frequencies."""

    speed: Complex
    heading: Complex
    height: Complex


def tau_responses(tau_v_s: float, tau_psi_s: float, heights_s: tuple[float, float]) -> Responses:
    """Return the responses of equation (7) at `FREQUENCIES`."""
    s = (1j * FREQUENCIES).astype(np.complex128)
    first, second = heights_s
    height = 1.0 / ((first * s + 1.0) * (second * s + 1.0))
    return Responses(1.0 / (tau_v_s * s + 1.0), 1.0 / (tau_psi_s * s + 1.0), height)


def airframe_responses(frequency_radps: Array, airframe: AirframeParameters, speed_mps: float) -> Responses:
    """Return the responses of one aircraft, small signals about level flight at `speed_mps`, dead time included."""
    matrix, inputs = linearised(airframe, speed_mps)
    z = np.exp(1j * frequency_radps * energy.ENERGY_S)
    late = np.exp(-1j * frequency_radps * airframe.dead_time_s)
    # The discrete system holds each setpoint for a period: take that out, exactly so for an integrator.
    late = (
        late
        * np.exp(1j * frequency_radps * energy.ENERGY_S / 2.0)
        * np.sinc(frequency_radps * energy.ENERGY_S / (2.0 * np.pi))
    )
    system = z[:, None, None] * np.eye(len(matrix)) - matrix
    every = np.broadcast_to(inputs, (z.size, *inputs.shape)).astype(np.complex128)
    states = (np.linalg.solve(system, every) * late[:, None, None]).astype(np.complex128)
    return Responses(speed=states[:, SPEED, 0], heading=states[:, HEADING, 1], height=states[:, HEIGHT, 2])


def slow_taus_s(airframe: AirframeParameters, speed_mps: float) -> tuple[float, float, float]:
    """Return by how much speed, heading and height lag behind setpoints that change slowly, at `SLOW_RADPS`."""
    at = airframe_responses(np.array([SLOW_RADPS]), airframe, speed_mps)
    speed, heading, height = (
        max(MIN_TAU_S, -float(np.angle(each[0])) / SLOW_RADPS) for each in (at.speed, at.heading, at.height)
    )
    return speed, heading, height


def linearised(airframe: AirframeParameters, speed_mps: float) -> tuple[Array, Array]:
    """Return the derivatives (S, S) and (S, 3) of an aircraft's state `energy.ENERGY_S` later, by state and inputs.

    The state is the aircraft's quantities; the inputs are setpoints of speed, heading and height. They are central
    differences about straight, level flight at `speed_mps`.
    """
    level = energy.Aircraft(0.0, 0.0, speed_mps, 0.0)
    energy.trim(level, airframe)
    trim = np.array([*level.values(), speed_mps, 0.0, 0.0])
    size = len(energy.QUANTITIES)
    steps = np.concatenate((SMALL, np.full(size - len(SMALL), INNER), SMALL[[SPEED, HEADING, HEIGHT]]))
    slopes = np.empty((size, trim.size))
    for index, step in enumerate(np.diag(steps)):
        slopes[:, index] = (_later(trim + step, airframe) - _later(trim - step, airframe)) / (2.0 * steps[index])
    return slopes[:, :size], slopes[:, size:]


def _later(begin: Array, airframe: AirframeParameters) -> Array:
    """Return an aircraft's quantities `energy.ENERGY_S` later; `begin` is the quantities, then the setpoints."""
    *quantities, speed_mps, heading_rad, height_m = begin.tolist()
    aircraft = energy.Aircraft(*quantities)
    commanded = energy.Commanded(speed_mps, math.inf, heading_rad, STRAIGHT_RAD, height_m)
    energy.control(aircraft, commanded, airframe)
    for _ in range(energy.CYCLES):
        energy.cycle(aircraft, commanded, airframe)
    return np.array(aircraft.values())


def delay_response(delay_s: float) -> Complex:
    """Return the frequency response of a delay."""
    return np.exp(-1j * FREQUENCIES * delay_s)


def mismatched(controller: Complex, plant: Complex) -> Iterator[Complex]:
    """Yield loops around a plant with mismatched time scale and gain: its response at w is the known one at w k."""
    log_w = np.log(FREQUENCIES)
    size: Array = np.log(np.maximum(np.abs(plant), LEAST))
    angle: Array = np.unwrap(np.angle(plant))
    for scale in (1.0 - MISMATCH, 1.0 + MISMATCH):
        moved = np.exp(_interp(size, log_w + np.log(scale))) * np.exp(1j * _interp(angle, log_w + np.log(scale)))
        for strength in (1.0 - MISMATCH, 1.0 + MISMATCH):
            yield strength * controller * moved


def _interp(values: Array, log_w: Array) -> Array:
    """Return values given at `FREQUENCIES`, interpolated at other frequencies, which are given by their logarithms."""
    return np.interp(log_w, np.log(FREQUENCIES), values)


def sensitivity_peak(loop: Complex) -> float:
    """Return the sensitivity peak; infinite if the loop is unstable by the Nyquist criterion."""
    back = 1.0 + loop
    angle = np.unwrap(np.angle(back))
    # With integrators the angle starts between -180 and 0 degrees; it must end near 0, without a turn around -1.
    stable = angle[0] < ROUNDING and abs(angle[-1]) < np.pi / 2
    return float(np.max(1.0 / np.abs(back))) if stable else float("inf")


def delay_margin_s(loop: Complex) -> float:
    """Return the least additional delay that makes the loop unstable, over all crossings of gain 1."""
    size = np.abs(loop)
    (crossings,) = np.nonzero((size[:-1] >= 1.0) != (size[1:] >= 1.0))
    if crossings.size == 0:
        return float("inf")
    phase = np.mod(np.angle(-loop[crossings]), 2.0 * np.pi)
    return float(np.min(phase / FREQUENCIES[crossings]))


def stable_delay_s(loop: Complex, integrators: int) -> float:
    """Return the least delay, s, that makes a loop unstable; 0 if it is unstable without, by the Nyquist criterion.

    All poles of the loop except its `integrators` are in the left half-plane; a factor s/(s + 1) removes each of these.

    Args:
        loop: at `FREQUENCIES`; a gain of 1 or more at the highest, above which it mustn't rise, counts as unstable.
        integrators: number of poles at 0.
    """
    if abs(loop[-1]) >= 1.0:
        return 0.0
    s = 1j * FREQUENCIES
    turned = np.unwrap(np.angle((1.0 + loop) * (s / (s + 1.0)) ** integrators))
    return delay_margin_s(loop) if max(abs(turned[0]), abs(turned[-1])) < np.pi / 2 else 0.0
