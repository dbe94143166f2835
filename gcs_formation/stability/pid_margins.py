"""Delay margins of the three PID loops (13)-(14) closed over the link around the autopilot model (7), or the aircraft.

The leader's motion is an input of these loops, so the feed-forward isn't part of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array, Complex
from flight_model.frequency_response import FREQUENCIES, stable_delay_s
from flight_model.slot import Vector3
from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, GainRange, PidGains
from gcs_formation.control.setpoint import Mixer

Coefficients = Array | Complex
MID_RANGE: Vector3 = (0.5, 0.5, 0.5)
"""(F_p, F_i, F_d) of the nominal gains with the default range."""

SMALL_SIGNAL: Vector3 = (0.5, 1.0, 0.5)
"""(F_p, F_i, F_d) from tables 1-3 at zero error, both printed and symmetrised."""

_LEVELS = 5
_FINER = (0.125, 0.0625, 0.03125, 0.015625, 0.0078125)


class Plant(NamedTuple):
    """From an autopilot's setpoint to the mixed error fed back: y = output . x, x' = state x + input u.

    The output is complex for a directed graph's mode with a complex eigenvalue.
    """

    state: tuple[tuple[float, float], tuple[float, float]]
    input: tuple[float, float]
    output: tuple[complex, complex]

    @cache  # noqa: B019 - there are few plants, and each is needed at every gain that its loop may have
    def transfer(self) -> tuple[Coefficients, Array]:
        """Numerator and denominator of c adj(sI - A) B / det(sI - A)."""
        a, b, c = np.array(self.state), np.array(self.input), np.array(self.output, dtype=np.complex128)
        trace, determinant = a[0, 0] + a[1, 1], a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
        numerator = np.array([c @ b, c @ (a - trace * np.eye(2)) @ b], dtype=np.complex128)
        return real_if_exact(numerator), np.array([1.0, -trace, determinant])

    @property
    def taus(self) -> int:
        """Number of the autopilot's time constants in it: two for the height, else one."""
        return 2 if self._restoring else 1

    @property
    def _restoring(self) -> bool:
        return self.state[0] == (0.0, 1.0) and self.state[1][0] != 0.0

    def with_time_constants(self, first: float, second: float = 1.0) -> Plant:
        """The plant of an autopilot whose time constants are `first` and `second` times as long."""
        if self._restoring:
            product, total = -self.state[1][0], -self.state[1][1]
            fast, slow = np.roots([1.0, -total, product]).real.tolist()
            fast, slow = fast / first, slow / second
            state = self.state[0], (-fast * slow, -fast - slow)
            return self._replace(state=state, input=(0.0, self.input[1] * fast * slow / product))
        rows = [(a / first, b / first) if own else (a, b) for (a, b), own in zip(self.state, self.input, strict=True)]
        return self._replace(state=(rows[0], rows[1]), input=(self.input[0] / first, self.input[1] / first))


class Rational(NamedTuple):
    """Ratio of polynomials in s, or a row for each of many; coefficients from the highest, nonzero power down."""

    numerator: Coefficients
    denominator: Coefficients

    def at(self, frequency: npt.ArrayLike) -> Complex:
        """Frequency response at w, rad/s."""
        s = np.asarray(1j * np.asarray(frequency, dtype=np.float64), dtype=np.complex128)
        return np.asarray(_values(self.numerator, s) / _values(self.denominator, s))

    @property
    def integrators(self) -> int:
        """Number of poles at 0."""
        values: npt.NDArray[np.float64] = np.abs(self.denominator)
        return len(values) - len(np.trim_zeros(values, "b"))

    def closed_loop_poles(self) -> Complex:
        """Poles with unit negative feedback."""
        return _roots(_sum(self.denominator, self.numerator))


@dataclass(frozen=True, eq=False, slots=True)
class AircraftResponse:
    """An aircraft's response to a setpoint in level flight, as a multiple of its model's by (7), at `FREQUENCIES`."""

    by_model: Complex

    def delay_margin_s(self, open_loop: Complex, integrators: int) -> float:
        """Return the delay margin, s, around the aircraft of a loop that has (7) in it; 0 if unstable without delay.

        Args:
            open_loop: L around (7) at `FREQUENCIES`, without delay.
            integrators: its number of poles at 0.
        """
        return stable_delay_s(open_loop * self.by_model, integrators)


@dataclass(frozen=True, slots=True)
class Loop:
    """One controlled axis with its gains frozen."""

    pid: PidGains
    plant: Plant
    aircraft: AircraftResponse | None = None
    """Response of the aircraft, in place of the plant's model (7)."""
    dead_time_s: float = 0.0
    """The autopilot's dead time, which uses up delay that the link may have."""

    def slowed(self, bandwidth: float) -> Loop:
        """The loop with gains for a share of its bandwidth."""
        return replace(self, pid=self.pid.slowed(bandwidth))

    def with_time_constants(self, first: float, second: float = 1.0) -> Loop:
        """The loop around an autopilot whose time constants are `first` and `second` times as long."""
        return replace(self, plant=self.plant.with_time_constants(first, second))

    def with_output(self, row: tuple[complex, complex]) -> Loop:
        """The loop with another output row: the combination of the plant's states that is fed back."""
        return replace(self, plant=self.plant._replace(output=row))

    def delay_margin_s(self) -> float:
        """Delay margin, s, around the aircraft if there is one; 0 or less if unstable without delay of the link."""
        return less_dead_time(self.whole_margin_s(), self.dead_time_s)

    def whole_margin_s(self) -> float:
        """Delay margin, s, likewise, of which the autopilot's dead time may be a part."""
        loop = self.open_loop()
        if self.aircraft is None:
            return delay_margin(loop)
        return self.aircraft.delay_margin_s(loop.at(FREQUENCIES), loop.integrators)

    def open_loop(self) -> Rational:
        """L(s) around (7), without delay."""
        (pid_zeros, pid_poles), (zeros, poles) = self.pid.transfer(), self.plant.transfer()
        return Rational(_product(pid_zeros, zeros), _product(pid_poles, poles))


def less_dead_time(margin_s: float, dead_time_s: float) -> float:
    """Return what a dead time leaves of a delay margin, s; a loop that is unstable without delay keeps its figure."""
    return margin_s - dead_time_s if margin_s > 0.0 else margin_s


def forward_plant(mixer: Mixer, model: VehicleModel) -> Plant:
    """Speed setpoint to mixed speed error: (k_v + k_x/s)/(tau_v s + 1)."""
    return _time_constant_and_integral(model.tau_v_s, mixer.k_v, mixer.k_x)


def right_plant(mixer: Mixer, model: VehicleModel, speed_mps: float, x_rc_m: float = 0.0) -> Plant:
    """Heading setpoint to mixed heading error: (k_psi + k_y (v1 + x_rc s)/s)/(tau_psi s + 1).

    Args:
        mixer: weights of (13).
        model: time constants of (7).
        speed_mps: the leader's speed v1.
        x_rc_m: how far the leader is ahead of the slot; 0 for slots in the leader's frame, which the
            follower's heading doesn't turn.
    """
    return _time_constant_and_integral(model.tau_psi_s, mixer.k_psi + mixer.k_y * x_rc_m, mixer.k_y * speed_mps)


def height_plant(mixer: Mixer, model: VehicleModel) -> Plant:
    """Height setpoint to mixed height error: k_z/((tau_ha s + 1)(tau_hb s + 1))."""
    a, b = model.tau_ha_s, model.tau_hb_s
    return Plant(((0.0, 1.0), (-1.0 / (a * b), -1.0 / a - 1.0 / b)), (0.0, 1.0 / (a * b)), (mixer.k_z, 0.0))


def delay_margin(open_loop: Rational) -> float:
    """Smallest delay in the loop at which it loses stability.

    Every gain crossover is found: |L(iw)| = 1 is a polynomial in w.

    Args:
        open_loop: proper L(s), with negative feedback; with complex coefficients, call this for the
            conjugate too: only crossovers above 0 rad/s are found.

    Returns:
        Seconds; negative or 0 if unstable without delay; infinite without a crossover. 0 also if
        |L| >= 1 at high frequency (an unfiltered derivative): any delay then destabilises.
    """
    return delay_margins([open_loop])[0]


def delay_margins(open_loops: Sequence[Rational]) -> list[float]:
    """Return the delay margin of each loop, s; many loops take little more time than a few."""
    of_degrees: dict[tuple[int, int], list[int]] = {}
    found = [0.0] * len(open_loops)
    for index, (numerator, denominator) in enumerate(open_loops):
        if (len(numerator), abs(numerator[0])) < (len(denominator), abs(denominator[0])):
            of_degrees.setdefault((len(numerator), len(denominator)), []).append(index)
    for indices in of_degrees.values():
        for index, margin_s in zip(indices, _margins_s(stacked([open_loops[i] for i in indices])), strict=True):
            found[index] = margin_s
    return found


def stacked(open_loops: Sequence[Rational]) -> Rational:
    """Return one `Rational` with a row for each loop; shorter polynomials begin with zeros."""
    numerators, denominators = zip(*open_loops, strict=True)
    return Rational(_rows(numerators), _rows(denominators))


def _rows(polynomials: Sequence[Coefficients]) -> Coefficients:
    longest = max(map(len, polynomials))
    rows: Coefficients = np.zeros((len(polynomials), longest), dtype=np.result_type(*polynomials))
    for row, polynomial in zip(rows, polynomials, strict=True):
        row[longest - len(polynomial) :] = polynomial
    return rows


def _margins_s(open_loops: Rational) -> list[float]:
    """Return the margins of loops whose coefficients are the rows (n, m); none has |L| >= 1 at high frequency."""
    numerators, denominators = (_squared_moduli(each) for each in open_loops)
    roots = _roots(_sum(denominators, -numerators))
    crossing = (roots.real > 0.0) & (np.abs(roots.imag) < 1e-7 * np.abs(roots))
    w = np.where(crossing, roots.real, 1.0)
    unstable = np.max(open_loops.closed_loop_poles().real, axis=-1, keepdims=True) >= 0.0
    phase = np.angle(-open_loops.at(w))
    margins_s = np.where(unstable, np.minimum(phase, 0.0), np.mod(phase, 2.0 * np.pi)) / w
    min_s: Array = np.min(margins_s, axis=-1, where=crossing, initial=np.inf)
    found_s: Array = np.where(unstable[:, 0], np.minimum(min_s, 0.0), min_s)
    return found_s.tolist()


def loop_margin(
    nominal: PidGains,
    plant: Plant,
    gain_range: GainRange = FIXED_GAINS,
    outputs: Vector3 = SMALL_SIGNAL,
    aircraft: AircraftResponse | None = None,
) -> float:
    """Delay margin, s, with the gains at the scheduler's outputs."""
    return Loop(gain_range.gains(nominal, outputs), plant, aircraft).delay_margin_s()


@cache
def worst_loop_margin(
    nominal: PidGains, plant: Plant, gain_range: GainRange, aircraft: AircraftResponse | None = None
) -> float:
    """Least delay margin, s, over all gains that the scheduler can reach: a grid of [0, 1]^3, then refined.

    It is for frozen gains, and says nothing about how fast they may change. As a rule the least is at a corner.
    """

    def lowest_of(of: Sequence[Vector3]) -> tuple[float, Vector3]:
        loops = [Loop(gain_range.gains(nominal, outputs), plant, aircraft) for outputs in of]
        return min(zip(_margins_of(loops), of, strict=True))

    if gain_range.span == 0.0:
        return loop_margin(nominal, plant, gain_range, MID_RANGE, aircraft)
    margin_s, outputs = lowest_of(list(product(np.linspace(0.0, 1.0, _LEVELS).tolist(), repeat=3)))
    for step in _FINER:
        margin_s, outputs = min((margin_s, outputs), lowest_of(_around(outputs, step)))
    return margin_s


def _margins_of(loops: Sequence[Loop]) -> list[float]:
    """Return the delay margin of each loop, s; either all or none are around aircraft."""
    if loops[0].aircraft is not None:
        return [each.delay_margin_s() for each in loops]
    return delay_margins([each.open_loop() for each in loops])


def _around(outputs: Vector3, step: float) -> list[Vector3]:
    """Return the outputs one step away along each axis, clipped to [0, 1]^3."""
    near = list[Vector3]()
    for axis, change in product(range(3), (-step, step)):
        moved = list(outputs)
        moved[axis] = min(max(moved[axis] + change, 0.0), 1.0)
        near.append((moved[0], moved[1], moved[2]))
    return near


def loop_delay_s(uplink_s: float, downlink_s: float, telemetry_rate_hz: float, law_rate_hz: float) -> float:
    """Delay of the loop closed over the link, to be compared with its margin.

    T = uplink + downlink + half a telemetry period (mean age of the newest sample) + half a control period (mean age
    of a held setpoint).
    """
    return uplink_s + downlink_s + 0.5 / telemetry_rate_hz + 0.5 / law_rate_hz


def _time_constant_and_integral(tau_s: float, proportional: float, integral: float) -> Plant:
    return Plant(((-1.0 / tau_s, 0.0), (1.0, 0.0)), (1.0 / tau_s, 0.0), (proportional, integral))


def real_if_exact(values: Coefficients) -> Coefficients:
    """Return real coefficients if all imaginary parts are 0."""
    return values if np.isrealobj(values) or values.imag.any() else values.real.copy()


def _product(polynomial: Coefficients, other: Coefficients) -> Coefficients:
    product = real_if_exact(np.convolve(polynomial, other))
    if product[0]:
        return product
    powers = np.flatnonzero(product)
    return product[powers[0] :] if powers.size else np.zeros(1)


def _sum(longer: Coefficients, shorter: Coefficients) -> Coefficients:
    total = np.array(longer, dtype=np.result_type(longer, shorter))
    total[..., longer.shape[-1] - shorter.shape[-1] :] += shorter
    return total


def _values(polynomials: Coefficients, s: Complex) -> Complex:
    """Values of each row's polynomial at the same row of s, by Horner's rule."""
    values = np.zeros_like(s)
    for power in range(polynomials.shape[-1]):
        values = values * s + polynomials[..., power, None]
    return values


def _roots(polynomials: Coefficients) -> Complex:
    """Return the roots (n, m - 1) of each row's polynomial (n, m): the eigenvalues of its companion matrix."""
    degree = polynomials.shape[-1] - 1
    companions = np.zeros((*polynomials.shape[:-1], degree, degree), dtype=polynomials.dtype)
    companions[..., range(1, degree), range(degree - 1)] = 1.0
    companions[..., 0, :] = -polynomials[..., 1:] / polynomials[..., :1]
    return np.linalg.eigvals(companions).astype(np.complex128)


def _squared_moduli(polynomials: Coefficients) -> Array:
    """|p(iw)|^2 of each row's polynomial (n, m), as polynomials in w (n, 2 m - 1)."""
    turns = np.asarray(1j ** np.arange(polynomials.shape[-1] - 1, -1, -1), dtype=np.complex128)
    along_axis: list[Complex] = list(polynomials * turns)
    return np.array([np.convolve(row, row.conj()).real for row in along_axis])
