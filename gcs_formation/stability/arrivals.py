"""How old the newest message of a periodic stream is over a link that loses some."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation_scenario.links import Impairment


class Arrivals(NamedTuple):
    """Mean and variance of the age of the newest message, in periods; delay apart. Infinite where nothing arrives."""

    mean_age: float
    age_variance: float

    @classmethod
    def over(cls, way: Impairment) -> Arrivals:
        """Return those over one way of a link that loses messages by Gilbert's two-state channel.

        N being the periods from one message that arrives to the next, the age has the mean E[N^2]/(2 E[N]) and the mean
        square E[N^3]/(3 E[N]). With the probability g = loss/(b (1 - loss)) a run of losses follows an arrival; its
        length is geometric with the mean b, so that E[N] = 1 + g b, E[N^2] = 1 + g (b + 2 b^2) and
        E[N^3] = 1 + g (b + 6 b^3). If each is lost on its own, b = 1/(1 - loss) and the mean is
        (1 + loss)/(2 (1 - loss)). Without loss: 1/2 and 1/12.
        """
        if way.outage or way.loss >= 1.0:
            return cls(math.inf, math.inf)
        odds = way.loss / (1.0 - way.loss)
        b = 1.0 + odds if way.mean_burst is None else max(way.mean_burst, odds, 1.0)
        mean = 1.0 + odds
        square, cube = (1.0 + odds / b * each for each in (b + 2.0 * b**2, b + 6.0 * b**3))
        mean_age = square / (2.0 * mean)
        return cls(mean_age, cube / (3.0 * mean) - mean_age**2)
