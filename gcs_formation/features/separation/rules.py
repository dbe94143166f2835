"""Rules between keys of the separation rule and others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from formation_scenario.model import Scenario
from formation_scenario.source import Finding
from gcs_formation.features.separation.keys import SeparationKeys


def distance(scenario: Scenario) -> Iterator[Finding]:
    """Yield a distance of the separation rule below the separation limit."""
    kept, min_m = SeparationKeys.of(scenario).avoidance, scenario.safety.separation_m
    if kept.enabled and kept.distance_m < min_m:
        path = ("safety", "avoidance", "distance_m")
        yield path, f"found {kept.distance_m:g}", f"at least separation_m, {min_m:g}"


RULES: Final = (distance,)
