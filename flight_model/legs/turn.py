"""Turns whose curvature is continuous, and so is its rate: nothing jumps for the vehicle, nor for slots far to a side.

The curvature rises from 0 to its peak as Bloss's transition curve, k(u) = k (3 u^2 - 2 u^3) over a length L, is
constant on an arc, and falls alike (A. E. Bloss, Organ fuer die Fortschritte des Eisenbahnwesens 73, 1936; compared
with the clothoid in W. Koc, Journal of Surveying Engineering 140, 2014). As with clothoids (T. Fraichard, A. Scheuer,
"From Reeds and Shepp's to continuous-curvature paths", IEEE Transactions on Robotics 20, 2004) each transition turns by
k L / 2; its steepest rate of curvature is 1.5 k / L. A turn too small for an arc has two transitions and a lower peak.

Points are complex numbers here, north + i east, or forward + i right of a turn's beginning; angles are clockwise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Complex

STEEPEST = 1.5
"""Largest derivative of 3 u^2 - 2 u^3."""
_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(14)
_SHARES: Array = (1.0 + _ABSCISSAE) / 2.0
_TURNED: Array = _SHARES**3 - _SHARES**4 / 2.0
TINY = 1e-12
NEGLIGIBLE_M = 1e-3
"""Stretches shorter than this are left out."""


class TurnLimits(NamedTuple):
    """The tightest turn that all vehicles can fly: curvature per m, and its rate per m of arc length."""

    curvature_1pm: float
    curvature_rate_1pm2: float

    @property
    def transition_rad(self) -> float:
        """The angle of both transitions of the tightest turn; smaller turns have no arc."""
        return STEEPEST * self.curvature_1pm**2 / self.curvature_rate_1pm2

    def widened(self, times: float) -> TurnLimits:
        """Return the limits of turns that are so many times as wide, and of the same form."""
        return TurnLimits(self.curvature_1pm / times, self.curvature_rate_1pm2 / times**2)


class Stretch(NamedTuple):
    """A piece of a path whose curvature changes from one value to another, by Bloss; straight if both are 0."""

    length_m: float
    from_1pm: float = 0.0
    to_1pm: float = 0.0


def turn_parts(angle_rad: Array, limits: TurnLimits) -> tuple[Array, Array, Array]:
    """Return the peak curvature (…), without sign, and the lengths of a transition and of the arc, for angles (…)."""
    size = np.abs(angle_rad)
    curvature, rate = limits
    peak = np.minimum(curvature, np.sqrt(size * rate / STEEPEST))
    transition_m = STEEPEST * peak / rate
    arc_m = np.maximum(size - peak * transition_m, 0.0) / np.maximum(peak, TINY)
    return peak, transition_m, np.where(peak < curvature, 0.0, arc_m)


def turn_length_m(angle_rad: Array, limits: TurnLimits) -> Array:
    """Return the lengths (…) of turns by angles (…), clockwise positive."""
    _, transition_m, arc_m = turn_parts(angle_rad, limits)
    return 2.0 * transition_m + arc_m


def turned_m(angle_rad: Array, limits: TurnLimits) -> Complex:
    """Return where turns by angles (…) end, forward + i right of where they begin, m.

    The transitions by Gauss-Legendre quadrature, whose error is below rounding; the arc in closed form.
    """
    peak, transition_m, arc_m = turn_parts(angle_rad, limits)
    blend_rad, arc_rad = peak * transition_m / 2.0, peak * arc_m
    phase = (2.0 * blend_rad)[..., None] * _TURNED
    blend = transition_m / 2.0 * (np.exp(1j * phase) @ _WEIGHTS)
    arc = (np.exp(1j * (blend_rad + arc_rad)) - np.exp(1j * blend_rad)) / (1j * np.maximum(peak, TINY))
    whole = np.exp(1j * (2.0 * blend_rad + arc_rad))
    right = blend + np.where(arc_m > 0.0, arc, 0.0) + whole * np.conj(blend)
    return np.where(angle_rad < 0.0, np.conj(right), right)


def turn_stretches(angle_rad: float, limits: TurnLimits) -> tuple[Stretch, ...]:
    """Return the stretches of a turn by an angle, clockwise positive; none for 0."""
    peak, transition_m, arc_m = (float(each) for each in turn_parts(np.asarray(angle_rad), limits))
    if transition_m < NEGLIGIBLE_M:
        return ()
    curvature = float(np.copysign(peak, angle_rad))
    arc = (Stretch(arc_m, curvature, curvature),) if arc_m > NEGLIGIBLE_M else ()
    return Stretch(transition_m, 0.0, curvature), *arc, Stretch(transition_m, curvature, 0.0)


def tangent_m(angle_rad: float, limits: TurnLimits) -> float:
    """Return the distance from where a turn begins to where the straights before and after it meet, m."""
    forward_m = float(turned_m(np.asarray(angle_rad), limits).real)
    return forward_m / (1.0 + float(np.cos(angle_rad)))
