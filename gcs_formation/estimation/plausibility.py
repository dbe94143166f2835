"""Which values of a sample aren't plausible, and how little they then weigh.

A value counts in full up to `IMPLAUSIBLE_SIGMAS` standard deviations from what is expected; beyond, its noise is taken
to be larger by the square of the excess.
"""

from __future__ import annotations

from typing import Final

from flight_model.autopilot_model import squared
from gcs_formation.estimation.noise import Values

IMPLAUSIBLE_SIGMAS: Final = 3.0
"""Standard deviations beyond which a value of a sample counts less, by the square of the excess."""
STRAYED: Final = 1.0
"""Added to their square, (m/s)²: what a vehicle may do between two samples that the model doesn't know of; of positions
and heights it is by the square of the time between them."""
STRAYED_ROUND: Final = 0.1 * 0.1
"""Added to the square of headings, rad²."""


def excesses(difference: Values, own: Values, elapsed_s: float) -> Values:
    """Return by how much a sample's values are off beyond what is plausible, squared; 1 for what is.

    `difference`: from what is expected, of the variances `own`.
    """
    place = squared(elapsed_s)
    return (
        _excess(difference[0], own[0], place),
        _excess(difference[1], own[1], place),
        _excess(difference[2], own[2], place),
        _excess(difference[3], own[3], STRAYED),
        _excess(difference[4], own[4], STRAYED),
        _excess(difference[5], own[5], STRAYED),
        _excess(difference[6], own[6], STRAYED),
        _excess(difference[7], own[7], STRAYED_ROUND),
    )


def _excess(difference: float, own: float, strayed: float) -> float:
    excess = squared(difference) / (IMPLAUSIBLE_SIGMAS**2 * (own + strayed))
    return excess if excess > 1.0 else 1.0


def plausible(excess: Values) -> bool:
    """Return whether all of a sample's values are."""
    a, b, c, d, e, f, g, h = excess
    return a == b == c == d == e == f == g == h == 1.0


def weighed(variances: Values, own: Values, excess: Values) -> Values:
    """Return the variances by which a sample's values are weighed.

    A value that is u times too far off is given a noise that makes its innovation's variance u² times as large.
    """
    return (
        variances[0] + own[0] * (excess[0] - 1.0),
        variances[1] + own[1] * (excess[1] - 1.0),
        variances[2] + own[2] * (excess[2] - 1.0),
        variances[3] + own[3] * (excess[3] - 1.0),
        variances[4] + own[4] * (excess[4] - 1.0),
        variances[5] + own[5] * (excess[5] - 1.0),
        variances[6] + own[6] * (excess[6] - 1.0),
        variances[7] + own[7] * (excess[7] - 1.0),
    )
