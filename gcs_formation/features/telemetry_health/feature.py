"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.telemetry_health.before_take_off import findings
from gcs_formation.features.telemetry_health.monitor import TelemetryHealth
from gcs_formation.features.telemetry_health.series import health_columns
from gcs_formation.features.telemetry_health.stages import Examined, RestartForgotten


def _stages(cycle: Cycle) -> list[Stage]:
    controller = cycle.controller
    health = TelemetryHealth(
        cycle.vehicles,
        controller.estimator.filters,
        controller.models,
        controller.history,
        cycle.log_event,
        cycle.scenario.safety.separation_m,
    )
    return [RestartForgotten(health), Examined(health)]


FEATURE = Feature(
    "flies by what telemetry says as far as that can be true",
    _stages,
    events={
        "health": "a quantity of a vehicle's telemetry isn't believed, by which evidence, or is again",
    },
    before_take_off=findings,
    columns=health_columns,
)
