"""The feature's stages: they share what is known of the vehicles."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from airlink.clock import after
from gcs_formation.features.telemetry_health.feature import FEATURE
from gcs_formation.features.telemetry_health.stages import Examined, RestartForgotten
from tests.gcs_formation.event_log import EventLog
from tests.gcs_formation.features.telemetry_health.test_late_positions import NOISE
from tests.gcs_formation.features.telemetry_health.test_what_is_flown_and_said import MODEL, START, Flight


def test_what_is_examined_is_forgotten_with_a_restart_and_logged() -> None:
    flight, logged = Flight(), EventLog()
    controller = SimpleNamespace(
        estimator=SimpleNamespace(filters=[NOISE]),
        models=[MODEL],
        history=SimpleNamespace(commanded=None),
        plan=SimpleNamespace(leader=0),
    )
    cycle: Any = SimpleNamespace(
        vehicles={0: flight.vehicle},
        controller=controller,
        log_event=logged,
        scenario=SimpleNamespace(safety=SimpleNamespace(separation_m=12.0)),
        each=[flight.vehicle],
        last_tick=None,
        restarted=[0],
    )
    forgotten, examined = FEATURE.stages(cycle)
    assert isinstance(forgotten, RestartForgotten)
    assert isinstance(examined, Examined)
    for number in range(80):
        cycle.samples = [flight.sample(off_m=(45.0 * (number >= 30), 0.0, 0.0))]
        cycle.now = after(START, flight.at_s)
        examined.run(cycle)
    assert flight.vehicle.unfit == "its position has jumped by 45 m"
    assert {event.kind for event in logged} == {"health"}
    forgotten.run(cycle)
    assert flight.vehicle.unfit == ""
