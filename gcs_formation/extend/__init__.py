"""What can be added: laws, filters, links, faults, aircraft …: base classes, and the functions that register them.

A class is registered by a decorator, keeps its keys in an inner pydantic model `Keys`, and is used by a scenario that
names it. docs/own-law.md is the tutorial, docs/extensions.md says when each is made, called and left.
"""

from __future__ import annotations

from formation_scenario.register import Extension
from formation_scenario.shapes import Shape, register_shape
from formation_scenario.simulated import (
    Aircraft,
    AirDisturbance,
    AirPoint,
    Carried,
    EmulatedVehicle,
    LinkProcess,
    Measured,
    NavigationSource,
    Place,
    VehicleFault,
    register_aircraft,
    register_disturbance,
    register_emulated_family,
    register_fault,
    register_link_process,
    register_navigation,
)
from gcs_formation.control.plain_values import (
    FollowerModel,
    FollowerSlot,
    GuidedLeader,
    MeasuredVehicle,
    RoundTrip,
    RoutePoint,
    Setpoint,
    State,
)
from gcs_formation.extend.autopilots import Autopilot, register_autopilot
from gcs_formation.extend.base import FollowerLaw, FormationLaw, Metric, Monitor, Recorder, SetpointFilter
from gcs_formation.extend.cycle import Cycle, Vehicle
from gcs_formation.extend.flight_window import FlightWindow
from gcs_formation.extend.register import (
    register_filter,
    register_formation_law,
    register_law,
    register_metric,
    register_monitor,
    register_recorder,
)
from gcs_formation.extend.station_parts import (
    DelayEstimator,
    LeaderGuidance,
    Predictor,
    register_delay_estimator,
    register_guidance,
    register_predictor,
)
from gcs_formation.recorder import Event

__all__ = [
    "AirDisturbance",
    "AirPoint",
    "Aircraft",
    "Autopilot",
    "Carried",
    "Cycle",
    "DelayEstimator",
    "EmulatedVehicle",
    "Event",
    "Extension",
    "FlightWindow",
    "FollowerLaw",
    "FollowerModel",
    "FollowerSlot",
    "FormationLaw",
    "GuidedLeader",
    "LeaderGuidance",
    "LinkProcess",
    "Measured",
    "MeasuredVehicle",
    "Metric",
    "Monitor",
    "NavigationSource",
    "Place",
    "Predictor",
    "Recorder",
    "RoundTrip",
    "RoutePoint",
    "Setpoint",
    "SetpointFilter",
    "Shape",
    "State",
    "Vehicle",
    "VehicleFault",
    "register_aircraft",
    "register_autopilot",
    "register_delay_estimator",
    "register_disturbance",
    "register_emulated_family",
    "register_fault",
    "register_filter",
    "register_formation_law",
    "register_guidance",
    "register_law",
    "register_link_process",
    "register_metric",
    "register_monitor",
    "register_navigation",
    "register_predictor",
    "register_recorder",
    "register_shape",
]
