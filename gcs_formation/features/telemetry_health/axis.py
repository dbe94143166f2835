# Compiled by mypyc: it runs every tick.

"""One coordinate of a position with its velocity: the sums by which they are compared, and what is flown instead.

`consistency` has what the sums are for, and their sources.
"""

from __future__ import annotations

import math
from typing import Final

SHORT_S: Final = 2.0
LONG_S: Final = 10.0
"""Memories of the two sums, s."""
ALPHA: Final = 0.4
BETA: Final = 0.1
"""Gains of the alpha-beta filter; together critically damped at some 4 samples."""
SIGMA_M: Final = 5.0
SQUARE_LIMIT: Final = 4.0
"""Noise of more than this standard deviation is said, m: less than it a GNSS receiver has, and what else is wrong isn't
found along with more. A sample adds up to this multiple of its square."""
SMOOTHED_S: Final = 10.0
"""What is noisy is carried by its velocity and moved to what is reported with this time constant, s: of white noise of
10 m at 10 Hz 0.7 m are left, of a velocity that is off by 0.1 m/s there comes 1 m."""
GAP_S: Final = 0.5
"""What is smoothed begins again after an interval longer than this, s."""


class Axis:
    """One coordinate: its sums, and what is flown instead of a wrong quantity."""

    def __init__(self) -> None:
        """Start without a sample."""
        self.position_m = math.nan
        """The newest position reported, m."""
        self.rate_mps = math.nan
        self.witness_mps = math.nan
        self.short_m = 0.0
        self.long_m = 0.0
        """What the position gains on the integral of the velocity, in the two sums, m."""
        self.unlike_m = 0.0
        """What it gains on the integral of the witness, in the short sum, m; NaN without one."""
        self.opposed_m = 0.0
        """What it gains on the integral of the opposite velocity, in the short sum, m."""
        self.moved_m = 0.0
        """How far it has moved since the sample before, m."""
        self.noise_m2 = 0.0
        """Variance of the position's noise by what samples gain one after the other, m²."""
        self.variance_m2 = self.taken_back_m2 = 0.0
        """The same, with a limit on what one sample adds: an outlier is no noise. The second is the newest's part."""
        self.gain_m = 0.0
        """What it gained on the velocities last, m."""
        self.excess_m = 0.0
        """What it has gained since a sum was first beyond its bound, that sum included, m."""
        self.offset_m = 0.0
        """What is added to the position reported, m."""
        self.before_m = 0.0
        """The same, before the fault that was found last."""
        self.smooth_m = math.nan
        """The position carried by its velocity, and moved slowly to what is reported, m."""
        self.flown_m = self.flown_mps = math.nan

    def take(
        self, elapsed_s: float, position_m: float, rate_mps: float, witness_mps: float, arc: float, share: float
    ) -> float:
        """Take the next sample after some time; return what its position gains on the velocities, m.

        `arc`: ratio of an arc's chord by the mean of the velocities at its ends; `share`: the sample's in the noise.
        """
        moved_m, half_s = position_m - self.position_m, elapsed_s / 2.0 * arc
        gained_m = moved_m - (rate_mps + self.rate_mps) * half_s
        kept = max(0.0, 1.0 - elapsed_s / SHORT_S)
        self.short_m = kept * self.short_m + gained_m
        self.long_m = (1.0 - elapsed_s / LONG_S) * self.long_m + gained_m
        before_m = 0.0 if math.isnan(self.unlike_m) else kept * self.unlike_m
        self.unlike_m = before_m + moved_m - (witness_mps + self.witness_mps) * half_s
        self.opposed_m = kept * self.opposed_m + moved_m + (rate_mps + self.rate_mps) * half_s
        self.moved_m = moved_m
        # What noise adds to one sample it takes from the next.
        self.noise_m2 += share * (0.0 - gained_m * self.gain_m - self.noise_m2)
        product_m2 = 0.0 - gained_m * self.gain_m
        product_m2 = min(max(product_m2, -SQUARE_LIMIT * SIGMA_M * SIGMA_M), SQUARE_LIMIT * SIGMA_M * SIGMA_M)
        self.variance_m2 += share * (product_m2 - self.variance_m2)
        self.taken_back_m2 = product_m2
        self.gain_m = gained_m
        return gained_m

    def fly(
        self, elapsed_s: float, position_m: float, rate_mps: float, witness_mps: float, *, derived: bool, waits: bool
    ) -> None:
        """Set what is flown by the newest sample, and keep it.

        `derived`: the velocity is that of the position; `waits`: the position is carried on, this time.
        """
        known_m, before_m, change_mps = position_m + self.offset_m, self.flown_m, witness_mps - self.witness_mps
        carried_m = self.smooth_m + (rate_mps + self.rate_mps) * elapsed_s / 2.0
        share = elapsed_s / SMOOTHED_S
        # A long gap, and the first sample, leave nothing to carry.
        self.smooth_m = carried_m + share * (known_m - carried_m) if share < GAP_S / SMOOTHED_S else known_m
        if math.isnan(self.smooth_m):
            self.smooth_m = known_m
        if not derived:
            self.flown_m, self.flown_mps = known_m - self.excess_m if waits else known_m, rate_mps
        elif math.isnan(before_m):
            by_position_mps = (position_m - self.position_m) / elapsed_s
            self.flown_m, self.flown_mps = known_m, by_position_mps if math.isnan(witness_mps) else witness_mps
        else:
            velocity_mps = self.flown_mps + (0.0 if math.isnan(change_mps) else change_mps)
            expected_m = before_m + velocity_mps * elapsed_s
            innovation_m = known_m - expected_m
            self.flown_m = expected_m + ALPHA * innovation_m
            self.flown_mps = velocity_mps + BETA * innovation_m / elapsed_s
        self.position_m, self.rate_mps, self.witness_mps = position_m, rate_mps, witness_mps

    def clear(self) -> None:
        """Reset the sums."""
        self.short_m = self.long_m = 0.0
        self.unlike_m = self.opposed_m = 0.0
