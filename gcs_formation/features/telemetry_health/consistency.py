# Compiled by mypyc: it runs every tick.

"""Whether what a vehicle says of its position, and of how fast it moves, can be true together.

From sample to sample a position moves by the integral of the velocity. What it gains on that is summed with a leak, in
two sums: a short one finds jumps and what is frozen, a long one finds slow drifts. White noise of positions stays in
such a sum once, noise of velocities adds up over its memory; both are known, so that the bounds are five standard
deviations and a constant for what isn't noise (a CUSUM test with a leak; Basseville and Nikiforov, "Detection of
Abrupt Changes", 1993, 2.2).

Which of the two is wrong? A position that has moved faster than the aircraft can, or that hasn't changed by a bit; a
velocity that is 0; else the one that agrees less with a third witness: the velocity by airspeed, heading and the wind
known before, the climb by the commanded height. Without one a velocity whose opposite agrees is; else the position.

- A wrong velocity is replaced by the position's own (an alpha-beta filter, led by the witness's changes).
- A wrong position is replaced by the last right one, carried on by the velocities. Once it moves with these again it
  may be displaced: an aircraft doesn't jump, so it is taken to be where it was carried, until a jump back.
"""

from __future__ import annotations

import math
from typing import Final

from gcs_formation.features.telemetry_health.axis import GAP_S, LONG_S, SHORT_S, SIGMA_M, Axis

FAR_M: Final = 9.0
OFTEN: Final = 0.6
BACK: Final = 0.25
"""Shares of samples that gain more than `FAR_M`, and that take back what noise beyond `SIGMA_M` has added to the one
before, from which on positions are noisy; a wrong velocity takes nothing back. Tuned: shares; 0.5 to 0.7, and 0.2 to
0.3; at 10 Hz noise of 10 m shows both in 0.7 s (99 of 100 draws in 1.6 s), noise of 3 m in 0.3 % of the time, and one
outlier of 20 m in ten samples in 1 %."""
FAR_MEMORY: Final = 4.0
BACK_MEMORY: Final = 3.0
"""Multiples of a sample's weight in the noise that it has in these shares."""
SHORT_M: Final = 2.0
LONG_M: Final = 4.0
"""Bounds of the sums in exact telemetry, m. A position rounded to a control loop's cycle is off by 0.5 m at 25 m/s."""
SIGMAS: Final = 5.0
GAPS: Final = 3.0
"""After an interval longer than this, and than so many usual ones, there is nothing to compare: a simulator that was
held up has stood still meanwhile, by its clock too or not."""
MEMORY: Final = 0.05
"""Weight of the newest interval in the usual one."""
SAME_M: Final = 1e-6
"""Positions nearer than this are the same, m: what is added where a vehicle is displaced rounds their last bits."""
UNCHANGED: Final = 2
"""A position that is the same to the bit so many times in a row is frozen, and a velocity that is 0 isn't filled. One
that isn't 0 may well be the same: that is straight flight."""
FROZEN_M: Final = 1.0
"""A height that is the same to the bit while its climb rate says that it moved by this, and five standard deviations
of that, is frozen, m: heights that are reported in whole metres change after one."""
FROZEN_FINE_M: Final = 0.5
FINE_M: Final = 0.1
"""The same of heights that have changed by less than the second, but not by 0, m: their steps are finer."""
OPPOSED_SHARE: Final = 0.25
"""A velocity has the wrong sign if its opposite leaves less than this share of what it leaves itself."""
CONFIRMED: Final = 3
"""So many samples in a row beyond a bound are no outlier."""
FEWEST: Final = 10
MIN_WEIGHT: Final = 0.05
"""Samples from which on the noise is known well enough to judge, and the smallest weight of one in it."""
AGREES_SHARE: Final = 0.5
RETURNS_S: Final = 3.0
"""What has been wrong is right again after it has kept this share of its bounds for this time, s."""
POSITION: Final = 0
VELOCITY: Final = 1


class Consistency:
    """A position of one or two coordinates and its velocity, as one vehicle reports them."""

    def __init__(self, axes: int, fastest_mps: float, scale: float = 1.0) -> None:
        """Start by believing both; `axes`: 2 for north and east, 1 for the height; `fastest_mps`: it can't be.

        `scale`: of the bounds, by which false alarms are traded for time.
        """
        self._fastest_mps, self._scale = fastest_mps, scale
        self.axes = [Axis() for _ in range(axes)]
        self.wrong: int | None = None
        """Which quantity isn't accepted: `POSITION`, `VELOCITY`, or None."""
        self.doubts_velocity = False
        """Whether the other axes of this velocity are already known to be wrong."""
        self.lasts = False
        """Whether it has been wrong again since: it isn't a single jump."""
        self.evidence_m = 0.0
        """What the position had gained on the velocity when this was found, m."""
        self._samples, self._since, self._beyond, self._faster = 0, 0, 0, False
        """How many were compared, in all and since the sums began; how many in a row were beyond a bound, and whether
        one moved too fast to be true."""
        self._begun = False
        """Whether the sums have begun: not at an outlier, which would stay in them."""
        self._waits = False
        self._doubtful = False
        """Whether which of the two is wrong was decided by the first samples alone, and is decided once more."""
        self._stamp_ns, self._usual_s = 0, GAP_S
        self._unchanged = [0, 0]
        """How many samples in a row had the same position, and the same velocity."""
        self._agrees_s = 0.0
        self._stood_s, self._passed_m, self._frozen_m = 0.0, 0.0, FROZEN_M
        """For how long a height has been the same, s, how far it would have moved meanwhile by its rate, m, and from
        which such distance on it is frozen."""
        self.is_noisy = False
        """Whether its position is too noisy."""
        self._far = self._back = 0.0
        """The shares of samples by which that is found."""
        self.sigma_m = 0.0
        """Its standard deviation when that was found, m."""

    @property
    def displaced_m(self) -> float:
        """How far from where it says the vehicle is taken to be, m."""
        return math.hypot(*[axis.offset_m for axis in self.axes])

    def forget(self) -> None:
        """Reset, as after a restart."""
        self.axes = [Axis() for _ in self.axes]
        self.wrong, self.lasts = None, False
        self._far = self._back = 0.0
        self._stamp_ns, self._unchanged, self._agrees_s = 0, [0, 0], 0.0
        self._samples, self._since, self._beyond, self._faster, self._begun = 0, 0, 0, False, False

    def take(
        self,
        stamp_ns: int,
        position_m: list[float],
        rate_mps: list[float],
        witness_mps: list[float],
        variances: tuple[float, float],
    ) -> bool:
        """Take a sample; return whether what is flown, `flown_m` and `flown_mps` of each axis, differs from it.

        Args:
            stamp_ns: when it was measured.
            position_m: of each axis.
            rate_mps: the velocity.
            witness_mps: the velocity by other quantities; NaN where there are none.
            variances: of the position's and the velocity's noise, m² and m²/s².
        """
        elapsed_s = (stamp_ns - self._stamp_ns) * 1e-9
        if elapsed_s < -GAP_S:  # its clock has wrapped round
            self._stamp_ns = 0
        elif elapsed_s <= 0.0:
            return self._flies_otherwise()
        begun, usual_s = self._stamp_ns > 0, self._usual_s
        self._usual_s += MEMORY * (min(elapsed_s, GAPS * usual_s) - usual_s) if begun else 0.0
        if begun and elapsed_s <= max(GAP_S, GAPS * usual_s):
            self._compare(elapsed_s, position_m, rate_mps, witness_mps, variances)
        else:
            self._since = 0
        self._stamp_ns = stamp_ns
        # A single jump isn't accepted before the next sample says whether it was an outlier.
        self._waits = self._faster and self.wrong is None
        for index, axis in enumerate(self.axes):
            axis.fly(
                elapsed_s,
                position_m[index],
                rate_mps[index],
                witness_mps[index],
                derived=self.wrong == VELOCITY,
                waits=self._waits,
            )
            if self.is_noisy and self.wrong is None:
                axis.flown_m = axis.smooth_m
        return self._flies_otherwise()

    def _flies_otherwise(self) -> bool:
        if self.wrong is not None or self._waits or self.is_noisy:
            return True
        for axis in self.axes:  # noqa: SIM110 - compiled, `any` costs ten times as much
            if axis.offset_m != 0.0:
                return True
        return False

    def _compare(
        self,
        elapsed_s: float,
        position_m: list[float],
        rate_mps: list[float],
        witness_mps: list[float],
        variances: tuple[float, float],
    ) -> None:
        arc, same_position, same_rate = self._arc(rate_mps), True, True
        self._samples += 1
        self._since += 1
        if self._since == 1:
            self._begun = False
        weight = max(1.0 / self._samples, MIN_WEIGHT)
        for index, axis in enumerate(self.axes):
            same_position = same_position and abs(position_m[index] - axis.position_m) < SAME_M
            same_rate = same_rate and rate_mps[index] == axis.rate_mps
            gained_m = axis.take(elapsed_s, position_m[index], rate_mps[index], witness_mps[index], arc, weight)
            if self.wrong == POSITION:
                axis.offset_m -= gained_m
        self._unchanged[POSITION] = self._unchanged[POSITION] + 1 if same_position else 0
        self._unchanged[VELOCITY] = self._unchanged[VELOCITY] + 1 if same_rate else 0
        self._watch_height(elapsed_s, rate_mps[0], same=same_position)
        self._watch_noise(weight)
        short, long = self._shares(elapsed_s, variances)
        share = max(short, long)
        # A frozen position agrees with the velocity of a vehicle that has stopped, and is still not where it is.
        frozen = self.wrong == POSITION and same_position and len(self.axes) > 1 and self.displaced_m > SHORT_M
        self._agrees_s = self._agrees_s + elapsed_s if share < AGREES_SHARE and not frozen else 0.0
        self._begin()
        if not self._begun:
            return
        self._count(share, elapsed_s, short=short >= long)
        if self.wrong is None and self._is_frozen(variances[1] * elapsed_s / 2.0):
            self.axes[0].excess_m = 0.0 - self._passed_m
            self._disbelieve()
        elif self._beyond >= CONFIRMED or (self._beyond and self._is_stuck()):
            self._disbelieve()
        elif self.wrong is not None and self._agrees_s >= RETURNS_S:
            self._accept(variances[0])

    def _watch_height(self, elapsed_s: float, rate_mps: float, *, same: bool) -> None:
        """Sum what a height that stays the same to the bit would have moved by its rate."""
        if same and len(self.axes) == 1:
            self._stood_s += elapsed_s
            self._passed_m += (rate_mps + self.axes[0].rate_mps) * elapsed_s / 2.0
            return
        self._stood_s, self._passed_m = 0.0, 0.0
        if 0.0 < abs(self.axes[0].moved_m) < FINE_M:
            self._frozen_m = FROZEN_FINE_M

    def _is_frozen(self, doubled: float) -> bool:
        """Return whether a height stays the same and its rate says otherwise; `doubled`: noise of a sum, m²/s."""
        if self._unchanged[POSITION] < UNCHANGED or len(self.axes) > 1:
            return False
        return abs(self._passed_m) > self._frozen_m + SIGMAS * math.sqrt(doubled * self._stood_s)

    def _watch_noise(self, weight: float) -> None:
        """Decide whether positions are too noisy; `weight`: of the newest sample in their noise."""
        max_m2 = gained_m2 = back_m2 = 0.0
        for axis in self.axes:
            max_m2 = max(max_m2, axis.variance_m2)
            gained_m2 += axis.gain_m * axis.gain_m
            back_m2 += axis.taken_back_m2
        bound_m2 = SIGMA_M * SIGMA_M
        self._far += min(FAR_MEMORY * weight, 1.0) * ((1.0 if gained_m2 > FAR_M * FAR_M else 0.0) - self._far)
        self._back += min(BACK_MEMORY * weight, 1.0) * ((1.0 if back_m2 > bound_m2 else 0.0) - self._back)
        often = self._far > OFTEN and self._back > BACK and max_m2 > bound_m2 / 4.0
        if self.is_noisy:
            self.is_noisy = max_m2 > bound_m2 / 4.0
        elif self._samples > 2 * FEWEST and (often or max_m2 > bound_m2):
            self.is_noisy, self.sigma_m = True, max(math.sqrt(max_m2), SIGMA_M)

    def _shares(self, elapsed_s: float, variances: tuple[float, float]) -> tuple[float, float]:
        """Return which shares the two sums have of their bounds."""
        short, long, doubled, noise_m2 = 0.0, 0.0, variances[1] * elapsed_s / 2.0, variances[0]
        for axis in self.axes:
            noise_m2 = max(noise_m2, axis.noise_m2)
            short += axis.short_m * axis.short_m
            long += axis.long_m * axis.long_m
        short_m = self._scale * (SHORT_M + SIGMAS * math.sqrt(noise_m2 + doubled * SHORT_S))
        long_m = self._scale * (LONG_M + SIGMAS * math.sqrt(noise_m2 + doubled * LONG_S))
        return math.sqrt(short) / short_m, math.sqrt(long) / long_m

    def _begin(self) -> None:
        """Begin the sums at a sample that follows the one before as its velocity says, or sometime."""
        if self._begun:
            return
        gain_m = math.hypot(*[axis.gain_m for axis in self.axes])
        noise_m = math.sqrt(max([axis.noise_m2 for axis in self.axes] + [0.0]))
        enough = self._since >= (FEWEST if self._samples < 2 * FEWEST else 2)
        self._begun = enough and (gain_m < SHORT_M + SIGMAS * noise_m or self._since >= 2 * FEWEST)
        for axis in self.axes:
            axis.clear()

    def _is_stuck(self) -> bool:
        """Return whether a position hasn't changed by a bit, or a velocity is 0, for some samples: no outlier does so.

        In level flight a height, and its rate of 0, are the same for long.
        """
        if len(self.axes) < 2:
            return False
        empty = self._unchanged[VELOCITY] >= UNCHANGED and not any(axis.rate_mps for axis in self.axes)
        return empty or self._unchanged[POSITION] >= UNCHANGED

    def _count(self, share: float, elapsed_s: float, *, short: bool) -> None:
        """Count samples beyond a bound: a single one may be an outlier, which the filter weighs."""
        self._beyond = self._beyond + 1 if share >= 1.0 else 0
        for axis in self.axes:
            begun_m = axis.short_m if short else axis.long_m
            axis.excess_m = begun_m if self._beyond == 1 else axis.excess_m + axis.gain_m
        faster = math.hypot(*[axis.moved_m for axis in self.axes]) > self._fastest_mps * elapsed_s
        self._faster = self._beyond > 0 and (self._faster or faster)

    def _disbelieve(self) -> None:
        """Decide which quantity is wrong, and reset the sums."""
        first, self.lasts = self.wrong is None, self.wrong is not None
        found = self._which() if first or self._doubtful else self.wrong
        self._doubtful = first
        if first:
            self.evidence_m = math.hypot(*[axis.excess_m for axis in self.axes])
        for axis in self.axes:
            if first:
                axis.flown_m, axis.before_m = math.nan, axis.offset_m
                axis.offset_m -= axis.excess_m if found == POSITION else 0.0
            elif found != self.wrong:
                axis.flown_m, axis.offset_m = math.nan, axis.before_m
            axis.clear()
        self._beyond, self._faster = 0, False
        self.wrong = found

    def _which(self) -> int:
        if self._faster or abs(self._passed_m) > self._frozen_m:
            return POSITION
        if self.doubts_velocity:
            return VELOCITY
        unlike, level = [axis.unlike_m for axis in self.axes], len(self.axes) > 1
        witnessed = not math.isnan(sum(unlike))
        if level or not witnessed:  # a height, and its rate of 0, are the same for long in level flight
            if self._unchanged[POSITION] >= UNCHANGED:
                return POSITION
            if self._unchanged[VELOCITY] >= UNCHANGED and not any(axis.rate_mps for axis in self.axes):
                return VELOCITY
        if witnessed:
            of_velocity = math.hypot(*[axis.unlike_m - axis.short_m for axis in self.axes])
            return VELOCITY if of_velocity > math.hypot(*unlike) else POSITION
        opposed_m = math.hypot(*[axis.opposed_m for axis in self.axes])
        gained_m = math.hypot(*[axis.short_m for axis in self.axes])
        return VELOCITY if opposed_m < OPPOSED_SHARE * gained_m else POSITION

    def _accept(self, position_variance: float) -> None:
        """Believe both again; a displacement that noise explains is forgotten."""
        self.wrong, self.lasts, self._agrees_s = None, False, 0.0
        noise_m2 = position_variance
        for axis in self.axes:
            noise_m2 = max(noise_m2, axis.noise_m2)
        if self.displaced_m < SHORT_M + SIGMAS * math.sqrt(noise_m2):
            for axis in self.axes:
                axis.offset_m = 0.0

    def _arc(self, rate_mps: list[float]) -> float:
        """Return the ratio of an arc's chord by the mean of the velocities at its ends: tan x / x, x half its angle."""
        if len(self.axes) < 2:
            return 1.0
        north, east = self.axes
        cross = north.rate_mps * rate_mps[1] - east.rate_mps * rate_mps[0]
        before = north.rate_mps * north.rate_mps + east.rate_mps * east.rate_mps
        later = rate_mps[0] * rate_mps[0] + rate_mps[1] * rate_mps[1]
        return 1.0 + cross * cross / (12.0 * max(before * later, 1.0))
