"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.telemetry_noise.noise import TelemetryNoise


def _stages(cycle: Cycle) -> list[Stage]:
    return [TelemetryNoise(cycle)]


FEATURE = Feature(
    "reports noise that isn't as declared, and airspeeds that aren't plausible",
    _stages,
    events={
        "noise": "a vehicle's telemetry isn't as noisy as declared, or is again",
        "airspeed": "a measured airspeed isn't plausible, or is again",
    },
)
