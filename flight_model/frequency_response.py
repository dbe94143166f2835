"""Frequency responses of autopilots from setpoints to motion: of equation (7), and of an airframe near its trim."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flight_model import energy
from flight_model.arrays import Array, Complex
from flight_model.energy import AirframeParameters

HEIGHT, SPEED, HEADING = (energy.QUANTITIES.index(name) for name in ("height_m", "speed_mps", "heading_rad"))
SMALL = np.array([1e-2, 1e-3, 1e-3, 1e-4])
"""Perturbations of height (m), climb and airspeed (m/s) and heading (rad), far inside every limit."""
INNER = 1e-4
STRAIGHT_RAD = 1.0
"""The bank's limit where nothing turns."""


@dataclass(frozen=True)
class Responses:
    """From setpoints to motion at (W,) frequencies, complex: of airspeed, heading and height, each to itself."""

    speed: Complex
    heading: Complex
    height: Complex


def lag_responses(
    frequency_radps: Array, tau_v_s: float, tau_psi_s: float, heights_s: tuple[float, float]
) -> Responses:
    """Return the responses of equation (7)."""
    s = (1j * frequency_radps).astype(np.complex128)
    first, second = heights_s
    height = 1.0 / ((first * s + 1.0) * (second * s + 1.0))
    return Responses(1.0 / (tau_v_s * s + 1.0), 1.0 / (tau_psi_s * s + 1.0), height)


def airframe_responses(frequency_radps: Array, airframe: AirframeParameters, speed_mps: float) -> Responses:
    """Return the responses of one aircraft, small signals about level flight at `speed_mps`, dead time included."""
    matrix, inputs = linearised(airframe, speed_mps)
    z = np.exp(1j * frequency_radps * energy.ENERGY_S)
    late = np.exp(-1j * frequency_radps * airframe.dead_time_s)
    # The setpoint of a tick is held until the next, half of which the state at its end doesn't show.
    late = (
        late
        * np.exp(1j * frequency_radps * energy.ENERGY_S / 2.0)
        * np.sinc(frequency_radps * energy.ENERGY_S / (2.0 * np.pi))
    )
    system = z[:, None, None] * np.eye(len(matrix)) - matrix
    every = np.broadcast_to(inputs, (z.size, *inputs.shape)).astype(np.complex128)
    states = (np.linalg.solve(system, every) * late[:, None, None]).astype(np.complex128)
    return Responses(speed=states[:, SPEED, 0], heading=states[:, HEADING, 1], height=states[:, HEIGHT, 2])


def linearised(airframe: AirframeParameters, speed_mps: float) -> tuple[Array, Array]:
    """Return the derivatives (S, S) and (S, 3) of an aircraft's state `energy.ENERGY_S` later.

    The state is the aircraft's quantities; the inputs are setpoints of speed, heading and height. Central differences
    about straight, level flight at `speed_mps`.
    """
    level = energy.Aircraft(0.0, 0.0, speed_mps, 0.0)
    energy.trim(level, airframe)
    trim = np.array([*level.values(), speed_mps, 0.0, 0.0])
    size = len(energy.QUANTITIES)
    steps = np.concatenate((SMALL, np.full(size - len(SMALL), INNER), SMALL[[SPEED, HEADING, HEIGHT]]))
    slopes = np.empty((size, trim.size))
    for place, step in enumerate(np.diag(steps)):
        slopes[:, place] = (_later(trim + step, airframe) - _later(trim - step, airframe)) / (2.0 * steps[place])
    return slopes[:, :size], slopes[:, size:]


def _later(begin: Array, airframe: AirframeParameters) -> Array:
    """Return an aircraft's quantities `energy.ENERGY_S` later; `begin` has its setpoints behind them."""
    *quantities, speed_mps, heading_rad, height_m = begin.tolist()
    aircraft = energy.Aircraft(*quantities)
    commanded = energy.Commanded(speed_mps, math.inf, heading_rad, STRAIGHT_RAD, height_m)
    energy.control(aircraft, commanded, airframe)
    for _ in range(energy.CYCLES):
        energy.cycle(aircraft, commanded, airframe)
    return np.array(aircraft.values())
