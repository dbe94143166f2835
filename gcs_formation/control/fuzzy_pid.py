"""The hybrid controller (14) without its feed-forward: a fuzzy scheduler of gains, and a PID for each channel.

Five triangular sets centred at -1, -1/2, 0, 1/2 and 1 (the outer two with shoulders), product inference and the
weighted average amount exactly to bilinear interpolation of the tables (errata item 29f).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from librt.vecs import vec
from mypy_extensions import i64

from flight_model.arrays import Array
from flight_model.autopilot_model import within
from flight_model.slot import UNKNOWN, Vector3

LEVELS = {"ZR": 0.0, "PL": 0.5, "PH": 1.0}
SETS: Final = 5
Gains = tuple[float, float, float, float, float, float, float, float, float]
"""k_p of the three channels, then k_i, then k_d."""
NO_GAINS: Gains = (*UNKNOWN, *UNKNOWN, *UNKNOWN)

# Rows are the error's rate from NH to PH, columns the error from NH to PH.
TABLE_P = """
PL PH PH PH PH
PL PL PL PL PH
ZR PL PL PL PH
ZR PL PL PL PL
ZR PH PH PH PL
"""
TABLE_I = """
ZR PL PL PL ZR
PL PL PH PL PL
PH PL PH PH PH
PL PL PL PL PL
PL PH PL PL PL
"""
TABLE_D = """
ZR ZR ZR ZR ZR
ZR PL PL PL ZR
PL PL PL PL PL
PH PL PL PL PL
PH PH PH PH PH
"""


Rules = tuple[tuple[float, ...], ...] | None
"""A table of 5 by 5 F in [0, 1], rows the error's rate; None: the paper's."""
PAPERS: tuple[Rules, Rules, Rules] = (None, None, None)


def rule_tables(kind: Literal["printed", "symmetric"], given: tuple[Rules, Rules, Rules] = PAPERS) -> Array:
    """Return (5, 5, 3): F_p, F_i, F_d by rate and error, as they are, or made symmetric in the error's sign (29g)."""
    papers = (TABLE_P, TABLE_I, TABLE_D)
    each = [
        _parse(paper) if table is None else np.array(table, dtype=np.float64)
        for paper, table in zip(papers, given, strict=True)
    ]
    tables = np.stack(each, axis=-1)
    return tables if kind == "printed" else (tables + tables[::-1, ::-1]) / 2


def _parse(table: str) -> Array:
    return np.array([LEVELS[word] for word in table.split()]).reshape(SETS, SETS)


@dataclass(frozen=True)
class PidGains:
    """Gains of kp + ki/s + kd s/(filter_s s + 1)."""

    kp: float
    ki: float
    kd: float
    filter_s: float = 0.1

    def slowed(self, bandwidth: float) -> PidGains:
        """Gains of a loop whose crossover frequency is reduced to the share `bandwidth` of its present one.

        Near crossover the loop of (13), (7) and the derivative falls like an integrator, so its crossover frequency is
        proportional to its gain. The integral's corner ki/kp is lowered with it, or its phase lag would grow; the
        derivative's corner kp/kd stays, because it cancels the autopilot's own time constant.
        """
        return PidGains(self.kp * bandwidth, self.ki * bandwidth**2, self.kd * bandwidth, self.filter_s)

    def transfer(self) -> tuple[Array, Array]:
        """Numerator and denominator in s; without integral gain the integrator is no part of the loop."""
        numerator = np.array([self.kp * self.filter_s + self.kd, self.kp + self.ki * self.filter_s, self.ki])
        denominator = np.array([self.filter_s, 1.0, 0.0])
        return (numerator[:-1], denominator[:-1]) if self.ki == 0.0 else (numerator, denominator)


@dataclass(frozen=True)
class GainRange:
    """Range of a gain under the fuzzy scheduler: nominal (base + span F), F in [0, 1]; it only adds (item 29e)."""

    base: float = 0.7
    span: float = 0.6

    def gains(self, nominal: PidGains, outputs: Vector3) -> PidGains:
        """Gains at the scheduler's outputs (F_p, F_i, F_d)."""
        f_p, f_i, f_d = outputs
        return PidGains(
            nominal.kp * (self.base + self.span * f_p),
            nominal.ki * (self.base + self.span * f_i),
            nominal.kd * (self.base + self.span * f_d),
            nominal.filter_s,
        )


FUZZY_GAINS = GainRange()
FIXED_GAINS = GainRange(base=1.0, span=0.0)


class FuzzyGainScheduler:
    """Infers how far each gain moves from its base value towards its maximum."""

    def __init__(
        self,
        tables: Literal["printed", "symmetric"] = "printed",
        rules: tuple[Rules, Rules, Rules] = PAPERS,
        gain_range: GainRange = FUZZY_GAINS,
    ) -> None:
        """Use the paper's tables, or `rules` of kp, ki and kd in their place; as they are, or symmetrised."""
        self.gain_range = gain_range
        """What the gains are at factors of 0 and 1."""
        factors: list[list[float]] = rule_tables(tables, rules).reshape(SETS * SETS, 3).T.tolist()
        self._p, self._i, self._d = vec[float](factors[0]), vec[float](factors[1]), vec[float](factors[2])

    def infer(self, error: npt.ArrayLike, error_rate: npt.ArrayLike) -> Array:
        """Return F_p, F_i, F_d in [0, 1], shape (..., 3), for normalised inputs of any shape (...).

        Inputs are broadcast against each other and clipped to [-1, 1].

        Raises:
            ValueError: an input is NaN, or the shapes can't be broadcast.
        """
        inputs = np.array(np.broadcast_arrays(error, error_rate), dtype=np.float64)
        if np.isnan(inputs).any():
            name = "error" if np.isnan(inputs[0]).any() else "error_rate"
            raise ValueError(f"{name}: found nan; allowed: numbers")
        errors: list[float] = inputs[0].ravel().tolist()
        rates: list[float] = inputs[1].ravel().tolist()
        return np.array(list(map(self.factors, errors, rates))).reshape(*inputs.shape[1:], 3)

    def factors(self, error: float, error_rate: float) -> Vector3:
        """Return F_p, F_i, F_d in [0, 1] for normalised inputs, which are clipped to [-1, 1]."""
        across = (within(error, -1.0, 1.0) + 1.0) * ((SETS - 1) / 2)
        down = (within(error_rate, -1.0, 1.0) + 1.0) * ((SETS - 1) / 2)
        column: i64 = min(i64(across), SETS - 2)
        row: i64 = min(i64(down), SETS - 2)
        corner: i64 = row * SETS + column
        across -= float(column)
        down -= float(row)
        return (
            _between(self._p, corner, across, down),
            _between(self._i, corner, across, down),
            _between(self._d, corner, across, down),
        )


def _between(table: vec[float], corner: i64, across: float, down: float) -> float:
    """Return the bilinear interpolation between four entries of a table, the first of which is at `corner`."""
    left, up = 1.0 - across, 1.0 - down
    upper = table[corner] * left + table[corner + 1] * across
    lower = table[corner + SETS] * left + table[corner + SETS + 1] * across
    return upper * up + lower * down


@dataclass(frozen=True)
class ChannelConstants:
    """Constants of one channel's controller."""

    nominal: PidGains
    error_scale: float
    """Mixed error that the scheduler normalises to 1."""
    rate_scale: float
    """Rate of the mixed error, per second, likewise."""
    anti_windup_s: float


class Pid:
    """One channel's controller, with its state."""

    def __init__(self, channel: ChannelConstants, scheduler: FuzzyGainScheduler | None) -> None:
        """Start with the integrator at trim (29); without a scheduler gains stay nominal."""
        self._channel = channel
        self._scheduler = scheduler
        self.kp, self.ki, self.kd = channel.nominal.kp, channel.nominal.ki, channel.nominal.kd
        self._kept, self._kept_for_s = 1.0, 0.0
        """Decay factor of the rate's filter, and the time step it was computed for."""
        self.integral = 0.0
        """Integral of k_i(t) e dt, so that a change of gain doesn't make the output jump (errata item 29b)."""
        self.rate = 0.0
        """Filtered rate of the error, per second."""

    def reset(self) -> None:
        """Reset the integral and the filter."""
        self.integral = self.rate = 0.0

    def retune(self, channel: ChannelConstants) -> None:
        """Use other constants from now on; the integral and the filtered rate are kept."""
        self._channel, self._kept, self._kept_for_s = channel, 1.0, 0.0

    def filter_rate(self, slope: float, dt_s: float) -> None:
        """Filter the error's rate by 1/(T s + 1), exactly for a `slope` that is constant over `dt_s`."""
        if dt_s != self._kept_for_s:
            self._kept, self._kept_for_s = math.exp(-dt_s / self._channel.nominal.filter_s), dt_s
        self.rate = self._kept * self.rate + (1.0 - self._kept) * slope

    def schedule(self, error: float, bandwidth: float) -> None:
        """Set the gains k_0 + F Delta k_max (14) by error and rate; `bandwidth` is a share of the loop's own."""
        nominal, channel, p, i, d = self._channel.nominal, self._channel, 1.0, 1.0, 1.0
        scheduler = self._scheduler
        if scheduler is not None:
            f_p, f_i, f_d = scheduler.factors(error / channel.error_scale, self.rate / channel.rate_scale)
            base, span = scheduler.gain_range.base, scheduler.gain_range.span
            p, i, d = base + span * f_p, base + span * f_i, base + span * f_d
        self.kp = p * nominal.kp * bandwidth
        self.ki = i * nominal.ki * (bandwidth * bandwidth)
        self.kd = d * nominal.kd * bandwidth

    def output(self, error: float) -> float:
        """Return the output before any limit."""
        return self.kp * error + self.integral + self.kd * self.rate

    def integrate(
        self, error: float, excess: float, dt_s: float, maximum: float = math.inf, *, grows: bool = True
    ) -> None:
        """Integrate over `dt_s`; `excess` (limited minus unlimited output) decays with `anti_windup_s` (29c).

        This back-calculation discharges the integral at most to 0: a charge of the opposite sign could leave by the
        integral gain only, which may be 0. `maximum` bounds the integral where `excess` is small because integral and
        derivative cancel. Unless it `grows`, the integral may only shrink.
        """
        before = self.integral
        grown = within(before + self.ki * error * dt_s, -maximum, maximum)
        if grows:
            unwound = grown + excess * (dt_s / self._channel.anti_windup_s)
            self.integral = within(unwound, min(grown, 0.0), max(grown, 0.0))
        else:
            self.integral = within(grown, min(before, 0.0), max(before, 0.0))
