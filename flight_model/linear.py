"""Frequency responses of autopilots from setpoints to motion: of equation (7), and of an airframe near its trim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flight_model import energy
from flight_model.airframe import AirframeParameters, Array

Complex = npt.NDArray[np.complex128]
SMALL = np.array([1e-2, 1e-3, 1e-3, 1e-4])
"""Perturbations of height (m), climb and airspeed (m/s) and heading (rad), far inside every limit."""
INNER = 1e-4
STRAIGHT_RAD = 1.0
"""The bank's limit where nothing turns."""


@dataclass(frozen=True)
class Responses:
    """From setpoints to motion at (W,) frequencies, complex: of airspeed, heading and height, each to itself."""

    frequency_radps: Array
    speed: Complex
    heading: Complex
    height: Complex
    height_by_speed: Complex
    """m of height for a m/s of the speed setpoint."""


def lag_responses(
    frequency_radps: Array, tau_v_s: float, tau_psi_s: float, heights_s: tuple[float, float]
) -> Responses:
    """Return the responses of equation (7)."""
    s = (1j * frequency_radps).astype(np.complex128)
    first, second = heights_s
    height = 1.0 / ((first * s + 1.0) * (second * s + 1.0))
    return Responses(frequency_radps, 1.0 / (tau_v_s * s + 1.0), 1.0 / (tau_psi_s * s + 1.0), height, 0.0 * s)


def airframe_responses(frequency_radps: Array, airframe: AirframeParameters, speed_mps: float) -> Responses:
    """Return the responses of one aircraft, small signals about level flight at `speed_mps`, dead time included."""
    matrix, inputs = linearised(airframe, speed_mps)
    z = np.exp(1j * frequency_radps * energy.ENERGY_S)
    late = np.exp(-1j * frequency_radps * float(airframe.dead_time_s[0]))
    # The setpoint of a tick is held until the next, half of which the state at its end doesn't show.
    late = (
        late
        * np.exp(1j * frequency_radps * energy.ENERGY_S / 2.0)
        * np.sinc(frequency_radps * energy.ENERGY_S / (2.0 * np.pi))
    )
    system = z[:, None, None] * np.eye(len(matrix)) - matrix
    every = np.broadcast_to(inputs, (z.size, *inputs.shape)).astype(np.complex128)
    states = (np.linalg.solve(system, every) * late[:, None, None]).astype(np.complex128)
    return Responses(
        frequency_radps,
        speed=states[:, energy.SPEED, 0],
        heading=states[:, energy.HEADING, 1],
        height=states[:, energy.HEIGHT, 2],
        height_by_speed=states[:, energy.HEIGHT, 0],
    )


def linearised(airframe: AirframeParameters, speed_mps: float) -> tuple[Array, Array]:
    """Return the derivatives (S, S) and (S, 3) of an aircraft's state `energy.ENERGY_S` later.

    The state is its motion and its inner table; the inputs are setpoints of speed, heading and height. Central
    differences about straight, level flight at `speed_mps`.
    """
    level = np.array([[0.0], [0.0], [speed_mps], [0.0]])
    trim = np.concatenate((level, energy.trimmed(level, airframe)))[:, 0]
    size, steps = len(trim), np.concatenate((SMALL, np.full(len(trim) - len(SMALL), INNER), SMALL[[2, 3, 0]]))
    nudges = np.diag(steps)
    many = np.concatenate((nudges, -nudges), axis=1)
    begin, inputs = trim[:, None] + many[:size], many[size:]
    told = energy.Told(
        speed_mps + inputs[0],
        np.full(inputs.shape[1], np.inf),
        inputs[1],
        np.full(inputs.shape[1], STRAIGHT_RAD),
        inputs[2],
    )
    motion, inner, all_alike = begin[:4].copy(), begin[4:].copy(), airframe.repeated(inputs.shape[1])
    energy.control(motion, inner, told, all_alike)
    for _ in range(energy.CYCLES):
        energy.cycle(motion, inner, told, all_alike)
    after = np.concatenate((motion, inner))
    slopes = (after[:, : size + 3] - after[:, size + 3 :]) / (2.0 * steps)
    return slopes[:, :size], slopes[:, size:]
