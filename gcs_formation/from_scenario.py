"""Builds parts of the station from a scenario: estimation, models, guidance, vehicles and sockets."""

from __future__ import annotations

import math

import numpy as np

from airlink.endpoint import Endpoint, VehicleId, parse_endpoint
from flight_model.arrays import Array
from flight_model.autopilot_model import AutopilotModel
from flight_model.path_offsets import Bounds
from flight_model.stops.timetable import Timetable
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.extensions import AUTOPILOT, DELAY_ESTIMATOR, GUIDANCE, PREDICTOR
from formation_scenario.gains import AUTO, design_delay_s
from formation_scenario.links import Links
from formation_scenario.navigation import NoisyNavigation
from formation_scenario.slot_assignment import models_by_index, vehicles_by_index
from formation_scenario.terrain import FOLLOWER_SHARE, LEADER_SHARE
from formation_scenario.vehicles import VehicleClock, family_of, reads_equivalent_airspeed
from formation_scenario.wind import Wind
from gcs_formation.control.laws import law_kind
from gcs_formation.control.own_guidance import OwnGuidance
from gcs_formation.control.own_predictor import OwnPrediction
from gcs_formation.estimation.airspeed import AirspeedCheck, AirspeedScale
from gcs_formation.estimation.noise_and_plausibility import RESOLUTION, UNDECLARED, VehicleNoise
from gcs_formation.estimation.projection import Pairing, Prediction, Projection
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.extend.autopilots import family_named, own_autopilot
from gcs_formation.guidance.added_steps import AddedSteps
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.guidance.slot_clearance import SlotClearance
from gcs_formation.guidance.timed_progress import TimedProgress
from gcs_formation.guidance.tracking import MIN_MPS
from gcs_formation.holding_pattern import first_straight_s, hold_turn_rps, pattern_fence, settle_s
from gcs_formation.link.link_health import Connection
from gcs_formation.link.own_delays import OwnDelays
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.command_delivery import GAP_S
from gcs_formation.vehicle.craft import Craft
from gcs_formation.vehicle.held_setpoint import FINE_HEIGHT_M_S
from gcs_formation.vehicle.vehicle import Vehicle

MAX_REPEATED_S = 1.0
"""Longest averaging time: in gusts, averages over more follow model (7) instead of the vehicle."""
MIN_OF_DECLARED = 0.25
"""Lower bound of estimated noise, as a share of the declared noise."""
GAP_TICKS = 2.5
"""Number of ticks by which acknowledgements of setpoints may be late, if longer than `GAP_S`."""


def as_known(scenario: Scenario) -> Scenario:
    """Return a scenario without what a station of real vehicles can't know, so that none of its parts uses that.

    It knows neither the air, nor what will happen to vehicles and links, nor how they differ in truth from what their
    models and navigation say; the wind, delays, noise, time constants and clocks are measured. Gains by design are for
    the delay that the scenario's links have, as one that it states (`law.design_delay_ms`).
    """
    return scenario.derived(_as_known)


def _as_known(scenario: Scenario) -> Scenario:
    law = scenario.law
    if law.gains == AUTO:
        law = law.model_copy(update={"design_delay_ms": 1e3 * design_delay_s(scenario)})
    vehicles = tuple(
        each.model_copy(update={"true_model": None, "true_navigation": None, "clock": VehicleClock(), "landing": None})
        for each in scenario.vehicles
    )
    unknown = {"wind": Wind(), "disturbances": (), "faults": (), "links": Links()}
    return scenario.model_copy(update={"law": law, "vehicles": vehicles, **unknown})


def projection(scenario: Scenario, history: SetpointHistory, models: list[AutopilotModel]) -> Projection:
    """Return the projection from measured states to those that the law acts on."""
    if scenario.law.delay_compensation:
        return _predictor(scenario, history, models)
    return Pairing(scenario.law.rate_hz).align if law_kind(scenario).mutual else lambda measured: measured


def _predictor(scenario: Scenario, history: SetpointHistory, models: list[AutopilotModel]) -> Projection:
    """Return what predicts the states over the links' delays: by equation (7), or by an extension."""
    chosen = scenario.law.predictor
    entry = None if chosen is None else scenario.registered.get(chosen.type, PREDICTOR)
    if chosen is None or entry is None:
        return Prediction(history, models, scenario.telemetry.rate_hz).predict
    return OwnPrediction(entry, chosen.parameters or {}, scenario, history, models).predict


def declared_noise(scenario: Scenario) -> list[VehicleNoise]:
    """Return the declared noise of every vehicle's telemetry; that of emulated vehicles without any is rounding.

    Errors shared by several samples aren't visible from sample to sample, so the declared noise is their lower bound.
    Correlated errors (`correlation_s`) aren't reduced by averaging over the time for which model (7) can be trusted in
    gusts. They count in full: a filter that trusted the model for longer would lose the vehicle.
    """
    sigma, minimum = np.tile(RESOLUTION, (2, 1 + len(scenario.followers), 1))
    first = 0 if scenario.leader else 1
    vehicles = [vehicle for vehicle in (scenario.leader, *scenario.followers) if vehicle is not None]
    for index, vehicle in enumerate(vehicles, first):
        if isinstance(vehicle.navigation, NoisyNavigation):
            white, repeated = _noise(vehicle.navigation), _repeated(vehicle.navigation, scenario.telemetry.rate_hz)
            seen = repeated == 1.0 and vehicle.navigation.correlation_s == 0.0
            sigma[index] = np.maximum(repeated * white, RESOLUTION)
            minimum[index] = np.maximum(sigma[index] * (MIN_OF_DECLARED if seen else 1.0), RESOLUTION)
        elif vehicle.autopilot != "emulator":
            sigma[index] = UNDECLARED
    stated = [False] * first + [isinstance(vehicle.navigation, NoisyNavigation) for vehicle in vehicles]
    each = zip(sigma.tolist(), minimum.tolist(), stated, strict=True)
    return [VehicleNoise(tuple(declared), tuple(lowest), stated=says) for declared, lowest, says in each]


def _noise(keys: NoisyNavigation) -> Array:
    """Return standard deviations (6,) in the order of `noise_and_plausibility.QUANTITIES`."""
    position_m, velocity_mps = keys.position_sigma_m, keys.velocity_sigma_mps
    heading_rad = math.radians(keys.heading_sigma_deg)
    return np.array((position_m, position_m, velocity_mps, velocity_mps, keys.airspeed_sigma_mps, heading_rad))


def _repeated(keys: NoisyNavigation, telemetry_hz: float) -> float:
    """Return the factor on standard deviations for a sensor slower than telemetry, which repeats its errors.

    Samples with one error count as one sample, up to a time of `MAX_REPEATED_S`.
    """
    return math.sqrt(max(1.0, min(telemetry_hz / keys.rate_hz, telemetry_hz * MAX_REPEATED_S)))


def autopilot_models(scenario: Scenario) -> list[AutopilotModel]:
    """Return the autopilot model of the leader and of each follower."""
    return [each.autopilot() for each in models_by_index(scenario)]


def leader_guidance(scenario: Scenario) -> LeaderGuidance:
    """Return the leader's guidance along the scenario's path."""
    speeds = scenario.speeds
    timed = TimedProgress(speeds) if isinstance(speeds, Timetable) else None
    return LeaderGuidance(
        path=scenario.leader_path,
        speed_mps=scenario.path.begin_mps,
        speeds=speeds if speeds.changes and timed is None else None,
        timed=timed,
        run_in_m=scenario.run_in_m,
        hold_speed_mps=scenario.path.begin_mps,
        hold_turn_rps=hold_turn_rps(scenario),
        climb_max_mps=min(each.climb_max_mps for each in models_by_index(scenario)),
        settle_s=settle_s(scenario),
        first_straight_s=first_straight_s(scenario),
        hovers=scenario.hovers,
        fence=pattern_fence(scenario),
        dt_s=1.0 / scenario.law.rate_hz,
    )


def added_steps(scenario: Scenario) -> AddedSteps | None:
    """Return the steps added to the leader's setpoints; None if there are none."""
    return AddedSteps(scenario.path.steps, 1.0 / scenario.law.rate_hz) if scenario.path.steps else None


def own_guidance(scenario: Scenario) -> OwnGuidance | None:
    """Return the leader's guidance from outside; None if our own steers it.

    Raises:
        RunAbortedError: it can't begin.
    """
    chosen = scenario.path.guidance
    entry = None if chosen is None else scenario.registered.get(chosen.type, GUIDANCE)
    if chosen is None or entry is None:
        return None
    return OwnGuidance(entry, chosen.parameters or {}, 1.0 / scenario.law.rate_hz)


def slot_clearance(scenario: Scenario) -> SlotClearance | None:
    """Return the ground clearance of followers' slots; None without terrain."""
    if scenario.terrain is None:
        return None

    def bounds(over_ground_mps: float) -> Bounds:
        """Return the bounds in the wind that is measured; the leader's own route may have its slope in any."""
        calm = scenario.rise_bounds(FOLLOWER_SHARE)
        slope = calm.slope * min(1.0, scenario.path.begin_mps / max(over_ground_mps, MIN_MPS))
        return Bounds(max(slope, scenario.rise_bounds(LEADER_SHARE).slope), calm.curvature_1pm)

    return SlotClearance(scenario.ground, scenario.terrain.clearance_m, bounds, scenario.formation.frame)


def autopilot_for(vehicle: PlannedVehicle, scenario: Scenario) -> Autopilot:
    """Return the autopilot interface of a vehicle of the scenario.

    Raises:
        RunAbortedError: that of an extension can't begin.
    """
    model, entry = vehicle.model, scenario.registered.get(vehicle.autopilot, AUTOPILOT)
    limits_mps = model.speed_min_mps, model.speed_max_mps
    scale = AirspeedScale(scenario.origin.alt_m, *limits_mps) if reads_equivalent_airspeed(vehicle) else None
    craft = Craft(vehicle.id, scenario.origin.geodetic, model, scale, 1.0 / scenario.law.rate_hz)
    if entry is not None:
        return own_autopilot(entry, vehicle.parameters or {}, craft)
    return family_named(family_of(vehicle)).of(craft)


def narrow_links(scenario: Scenario) -> frozenset[VehicleId]:
    """Return the vehicles behind a radio, a serial line or a link of limited rate, to which little more can be sent."""
    behind_radios = {each.vehicle_id for _, shared in scenario.channel_members() for each in shared}
    limited = (
        each.vehicle_id
        for each in scenario.vehicles
        if any(parse_endpoint(text).kind == "serial" for text in each.endpoints)
        or any(direction.rate_kbps for step in scenario.link_steps(each) for direction in (step.uplink, step.downlink))
    )
    return frozenset(behind_radios).union(limited)


def planned(scenario: Scenario) -> tuple[tuple[Endpoint, ...], tuple[int, ...], dict[VehicleId, Vehicle]]:
    """Return the endpoint of each socket, its MAVLink network, and the vehicles, the leader first.

    There is a socket for each different endpoint; no vehicle has been received yet.
    """
    order = {index: vehicle for index, vehicle in enumerate(vehicles_by_index(scenario)) if vehicle is not None}
    texts = list(sockets(scenario))
    endpoints = tuple(parse_endpoint(text) for text in texts)
    vehicles = {
        each.vehicle_id: _vehicle(each, index, [texts.index(text) for text in each.endpoints], endpoints, scenario)
        for index, each in order.items()
    }
    return endpoints, tuple(each[0].network for each in sockets(scenario).values()), vehicles


def sockets(scenario: Scenario) -> dict[str, list[PlannedVehicle]]:
    """Return the endpoint of each socket, in the sockets' order, with its vehicles."""
    found = dict[str, list[PlannedVehicle]]()
    for vehicle in vehicles_by_index(scenario):
        if vehicle is not None:
            for text in vehicle.endpoints:
                found.setdefault(text, []).append(vehicle)
    return found


def _vehicle(
    planned: PlannedVehicle, index: int, own: list[int], endpoints: tuple[Endpoint, ...], scenario: Scenario
) -> Vehicle:
    """Return a vehicle with a link at each of its `own` sockets."""
    telemetry = scenario.telemetry
    autopilot = autopilot_for(planned, scenario)
    autopilot.station = scenario.station.ids
    check = None if autopilot.hovers else AirspeedCheck(planned.model.speed_min_mps, planned.model.speed_max_mps)
    vehicle = Vehicle(
        planned.vehicle_id,
        index,
        autopilot,
        [Connection(socket, endpoints[socket].peer) for socket in own],
        telemetry.rate_hz,
        by_utc=telemetry.by_utc,
        airspeed_check=check,
        setpoint_gap_s=max(GAP_S, GAP_TICKS / scenario.law.rate_hz),
    )
    if planned.model.airframe is not None or scenario.terrain is not None:
        vehicle.setpoints.held.height_m_s = FINE_HEIGHT_M_S
    entry = scenario.registered.get(telemetry.clock, DELAY_ESTIMATOR)
    if entry is not None:
        for link in vehicle.each_link:
            link.round_trips.own = OwnDelays(entry, telemetry.parameters or {}, planned.vehicle_id)
    return vehicle
