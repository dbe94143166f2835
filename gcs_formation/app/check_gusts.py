"""What `check` says of the errors that gusts leave.

A gust moves a vehicle at its own velocity until the law has answered. With d the gust's velocity, L the open loop
without its delay T, and O = exp(-sT) w/(s + w) the wind's observer, whose answer is led over the autopilot's lags, the
error is d (1 - O)/s times 1/(1 + L exp(-sT)) without prediction, and 1 - exp(-sT) L/(1 + L) with it. Under the
consensus law a mode of eigenvalue lambda leaves d/(s + k), k = lambda k1/(s + k3 + lambda k2), likewise. The error's
variance is the integral of this response, squared, over Dryden's spectra (MIL-F-8785C, 3.7.1.2). Gusts on leader and
follower are independent. Vehicles that hover hold their velocity over ground by themselves, and aren't judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array, Complex
from flight_model.frequency_response import FREQUENCIES
from formation_scenario import Scenario
from formation_scenario.surroundings import DrydenTurbulence
from gcs_formation.app.loop_waits import configured_loop_delay_s
from gcs_formation.control.laws import law_kind
from gcs_formation.stability import law_loops
from gcs_formation.stability.pid_margins import Loop

AXES = "xyz"
NAMES = {"x": "along the path", "y": "across it", "z": "in height"}
SIGMAS = 2.0
"""Standard deviations within which errors are for 95 % of the time."""
WORTH_M = 2.0
"""Error by gusts, `SIGMAS` of it, that is worth a warning."""


def errors(scenario: Scenario) -> Iterator[str]:
    """Yield what errors each entry of turbulence leaves, beside those that it would leave without the links' delay."""
    if scenario.hovers or not scenario.followers:
        return
    delay_s = configured_loop_delay_s(scenario)
    at_once_s = 0.5 / scenario.telemetry.rate_hz + 0.5 / scenario.law.rate_hz
    for index, entry in enumerate(scenario.disturbances):
        if not isinstance(entry, DrydenTurbulence):
            continue
        left_m = {axis: SIGMAS * each for axis, each in gust_errors_m(scenario, entry, delay_s).items()}
        if max(left_m.values(), default=0.0) < WORTH_M:
            continue
        least_m = {axis: SIGMAS * each for axis, each in gust_errors_m(scenario, entry, at_once_s).items()}
        found = ", ".join(f"{each_m:.1f} m {NAMES[axis]}" for axis, each_m in left_m.items())
        least = ", ".join(f"{each_m:.1f}" for each_m in least_m.values())
        without = f"; {least} m without the links' delay" if delay_s > at_once_s else ""
        yield f"disturbances.{index}: gusts leave errors of up to {found} for 95% of the time{without}"


def gust_errors_m(scenario: Scenario, entry: DrydenTurbulence, delay_s: float) -> dict[str, float]:
    """Return the largest standard deviation of any follower's error by turbulence on each axis that the law closes.

    The lowest point of the path counts, and a loop's delay `delay_s`.
    """
    lowest_m = np.array([min(height_m for _, _, height_m in scenario.path.waypoints_m)])
    sigma_mps, scale_m = (each[:, 0].tolist() for each in entry.scales(lowest_m))
    mutual, pair = law_kind(scenario).mutual, math.sqrt(1.0 if scenario.leader is None else 2.0)
    found = dict[str, float]()
    for name, loops in {each for axes in law_loops(scenario).values() for each in axes.items()}:
        for axis in "xy" if mutual else name:
            i = AXES.index(axis)
            spectrum = _dryden(i, sigma_mps[i], scale_m[i] / scenario.path.speed_mps)
            for loop in loops:
                response = _of_mode(scenario, loop, delay_s) if mutual else _of_channel(scenario, loop, delay_s, axis)
                variance = float(np.trapezoid(spectrum * np.abs(response) ** 2, FREQUENCIES))
                found[axis] = max(found.get(axis, 0.0), pair * math.sqrt(variance))
    return dict(sorted(found.items()))


def _dryden(axis: int, sigma_mps: float, scale_s: float) -> Array:
    """Return the one-sided spectrum at `FREQUENCIES` of gusts along the path, or across and vertical."""
    turned = np.square(FREQUENCIES * scale_s)
    shape = 2.0 / (1.0 + turned) if axis == 0 else (1.0 + 3.0 * turned) / np.square(1.0 + turned)
    return sigma_mps**2 * scale_s / math.pi * shape


def _of_channel(scenario: Scenario, loop: Loop, delay_s: float, axis: str) -> Complex:
    """Return the response from a gust's velocity to the error, at `FREQUENCIES`, of a PID channel."""
    s = 1j * FREQUENCIES
    late, open_loop = np.exp(-s * delay_s), loop.open_loop().at(FREQUENCIES)
    if loop.aircraft is not None:
        open_loop = open_loop * loop.aircraft.by_model
    observer_radps = scenario.law.disturbance_observer_radps if axis != "z" else 0.0
    unseen = (1.0 - late * observer_radps / (s + observer_radps)) / s
    if scenario.law.delay_compensation:
        return np.asarray(unseen * (1.0 - late * open_loop / (1.0 + open_loop)), np.complex128)
    return np.asarray(unseen / (1.0 + late * open_loop), np.complex128)


def _of_mode(scenario: Scenario, loop: Loop, delay_s: float) -> Complex:
    """Return the same of a mode of the consensus; none of the speed that all have in common."""
    s = 1j * FREQUENCIES
    (_, integral), (_, damping) = loop.plant.state
    if integral != 1.0 and damping == -1.0:
        return np.zeros(s.shape, np.complex128)
    position, velocity = loop.plant.output
    late = np.exp(-s * delay_s)
    answer = position / (s - damping + velocity)
    if scenario.law.delay_compensation:
        return np.asarray((1.0 - late * answer / (s + answer)) / s, np.complex128)
    return np.asarray(1.0 / (s + late * answer), np.complex128)
