"""Rules between keys of the fence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from formation_scenario.model import Scenario
from formation_scenario.source import Finding
from gcs_formation.features.airspace.keys import AirspaceKeys


def fence(scenario: Scenario) -> Iterator[Finding]:
    """Yield a fence whose lowest height is above its highest, and areas that are no polygon or circle, or both."""
    limits, key = AirspaceKeys.of(scenario).fence, ("safety", "fence")
    if limits is None:
        return
    lowest_m, highest_m = limits.heights_m
    if lowest_m > highest_m:
        yield (*key, "height_min_m"), f"found {lowest_m:g} m", f"up to height_max_m, {highest_m:g} m"
    for index, area in enumerate(limits.areas):
        found = [name for name in ("corners_m", "centre_m", "radius_m") if getattr(area, name) is not None]
        if found not in (["corners_m"], ["centre_m", "radius_m"]):
            allowed = "corners_m of a polygon, or centre_m and radius_m of a circle"
            yield (*key, "areas", index), f"found {' and '.join(found) or 'neither corners nor centre'}", allowed


RULES: Final = (fence,)
