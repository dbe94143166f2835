"""The functions that register a class: each notes it in the namespace of the module that it is written in.

So a registration belongs to the run that loads that module, and a module that is only imported changes nothing.
"""

from __future__ import annotations

from formation_scenario.extensions import FILTER, FORMATION_LAW, LAW, METRIC, MONITOR, RECORDER
from formation_scenario.register import Decorator, decorator
from gcs_formation.extend.base import FollowerLaw, FormationLaw, Metric, Monitor, Recorder, SetpointFilter


def register_law(name: str) -> Decorator[type[FollowerLaw]]:
    """Register a law for each follower, which `law.type: NAME` chooses; `law.parameters` are its keys."""
    return decorator(LAW, name, FollowerLaw)


def register_formation_law(name: str) -> Decorator[type[FormationLaw]]:
    """Register a law over all followers at once, which `law.type: NAME` chooses; `law.parameters` are its keys."""
    return decorator(FORMATION_LAW, name, FormationLaw)


def register_filter(name: str) -> Decorator[type[SetpointFilter]]:
    """Register a setpoint filter, which is on if `extensions: {NAME: {…its keys}}` names it."""
    return decorator(FILTER, name, SetpointFilter)


def register_monitor(name: str) -> Decorator[type[Monitor]]:
    """Register a monitor, which is on if `extensions: {NAME: {…its keys}}` names it."""
    return decorator(MONITOR, name, Monitor)


def register_recorder(name: str) -> Decorator[type[Recorder]]:
    """Register a recorder, which is on if `extensions: {NAME: {…its keys}}` names it."""
    return decorator(RECORDER, name, Recorder)


def register_metric(name: str) -> Decorator[type[Metric]]:
    """Register a metric, for `expect` and studies' `metrics`; `extensions: {NAME: {…}}` has its keys, if it has any."""
    return decorator(METRIC, name, Metric)
