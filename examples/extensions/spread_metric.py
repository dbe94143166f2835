"""A metric, for `expect` and studies: the greatest distance between any two vehicles."""

from itertools import combinations

import numpy as np

from gcs_formation.extend import FlightWindow, Metric, register_metric


@register_metric("spread_m")  # expect: [{metric: spread_m, below: 120}]
class Spread(Metric):
    """By ground truth if there is any, else by what the station knew."""

    def measure(self, flight: FlightWindow) -> float | None:
        """Return it over the window, m; None for one vehicle alone, or without a tick."""
        names = [f"{'true_' if flight.truth else ''}{each}_m" for each in ("north", "east", "height")]
        places = [np.stack([own[name] for name in names]) for own in flight.vehicles.values()]
        distance_m = [np.linalg.norm(one - other, axis=0) for one, other in combinations(places, 2)]
        return float(np.nanmax(distance_m)) if distance_m and flight.time_s.size else None
