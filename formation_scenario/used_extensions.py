"""Which of the extensions that a scenario was loaded with it uses."""

from __future__ import annotations

from collections.abc import Iterator

from formation_scenario.extensions import (
    AIRCRAFT,
    AUTOPILOT,
    DELAY_ESTIMATOR,
    DISTURBANCE,
    EMULATED_FAMILY,
    FAULT,
    GUIDANCE,
    LAW_KINDS,
    LINK,
    METRIC,
    NAVIGATION,
    PREDICTOR,
    SWITCHED,
    Registered,
)
from formation_scenario.model import Scenario
from formation_scenario.orders import read_order
from formation_scenario.shapes import SHAPE


def used_extensions(scenario: Scenario) -> tuple[Registered, ...]:
    """Return what a scenario uses of the extensions, each once."""
    known = scenario.registered
    if not known:
        return ()
    named = [known.get(scenario.law.type, *LAW_KINDS)]
    named += [known.get(name, *SWITCHED, METRIC) for name in scenario.extensions]
    named += [known.get(each.metric, METRIC) for each in scenario.expect]
    named += [known.get(name, SHAPE) for name in _shapes(scenario)]
    named += _used_by_station(scenario)
    named += _used_by_emulators(scenario)
    return tuple(dict.fromkeys(each for each in named if each is not None))


def _shapes(scenario: Scenario) -> Iterator[str | None]:
    """Yield the names of the formation's shapes: at the start, planned, and ordered."""
    yield scenario.formation.shape
    yield from (change.shape for change in scenario.formation.changes)
    texts = [order.order for _, order in scenario.timed_orders] + [act.order for _, act in scenario.scripted]
    changes = (read_order(text).change for text in texts if text is not None)
    yield from (change.shape for change in changes if change is not None)


def _used_by_station(scenario: Scenario) -> Iterator[Registered | None]:
    """Yield what prediction, estimation and guidance use of the extensions, and the vehicles' autopilots."""
    known, predictor, guidance = scenario.registered, scenario.law.predictor, scenario.path.guidance
    yield known.get(None if predictor is None else predictor.type, PREDICTOR)
    yield known.get(scenario.telemetry.clock, DELAY_ESTIMATOR)
    yield known.get(None if guidance is None else guidance.type, GUIDANCE)
    yield from (known.get(each.autopilot, AUTOPILOT) for each in scenario.vehicles)


def _used_by_emulators(scenario: Scenario) -> Iterator[Registered | None]:
    """Yield what links, faults, the air and vehicles use of the extensions; None for each that is ours."""
    known, acts = scenario.registered, [act for _, act in scenario.scripted]
    for group in (scenario.links.default, scenario.links, *scenario.links.changes, *(act.link for act in acts)):
        for patch in (group, getattr(group, "uplink", None), getattr(group, "downlink", None)):
            yield known.get(getattr(patch, "process", None), LINK)
    faults = (*scenario.faults, *(act.fault for act in acts if act.fault is not None))
    yield from (known.get(each.kind, FAULT) for each in faults)
    air = (*scenario.disturbances, *(act.disturbance for act in acts if act.disturbance is not None))
    yield from (known.get(each.kind, DISTURBANCE) for each in air)
    for vehicle in scenario.vehicles:
        for navigation in (vehicle.navigation, vehicle.true_navigation):
            yield known.get(None if navigation is None else navigation.source, NAVIGATION)
        for model in (vehicle.model, vehicle.true_model):
            yield known.get(None if model is None else model.aircraft, AIRCRAFT)
        yield known.get(vehicle.own_family, EMULATED_FAMILY)
