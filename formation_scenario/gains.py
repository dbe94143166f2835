"""The law's gains: two sets, for exact telemetry and for telemetry as noisy as GNSS, and `auto`, by design."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from flight_model.frequency_response import FREQUENCIES, Responses, airframe_responses, tau_responses
from flight_model.gain_design import (
    UNMODELLED,
    Axis,
    DelayAndNoise,
    DesignedChannel,
    consensus_gains,
    design,
    judged_channels,
    left_by_filter,
)
from flight_model.slot import CHANNELS
from formation_scenario.law import K1, K2, K3
from formation_scenario.model import Scenario
from formation_scenario.navigation import NoisyNavigation
from formation_scenario.source import Key, Plain, plain_mapping
from formation_scenario.vehicles import VehicleModel

Group = dict[Key, Plain]
"""A group of scenario keys."""

AUTO, CLEAN, NOISE = "auto", "clean", "noise"
LEADER, FOLLOWER = "leader_heading", "follower_heading"

GROUPS: dict[str, dict[str, Group]] = {
    CLEAN: {
        "mixer": {"k_v": 0.1, "k_x": 1.0, "k_psi": 0.1, "k_y": 0.05, "k_z": 1.0},
        "speed": {"kp": 3.0, "ki": 0.8, "kd": 6.5, "error_scale": 1.0, "rate_scale": 1.0},
        "height": {"kp": 2.0, "ki": 0.4, "kd": 4.0, "error_scale": 2.0, "rate_scale": 2.0},
    },
    NOISE: {
        "mixer": {"k_v": 0.5, "k_x": 0.5, "k_psi": 0.1, "k_y": 0.05, "k_z": 1.0},
        "speed": {"kp": 1.0, "ki": 0.1, "kd": 1.0, "error_scale": 1.0, "rate_scale": 1.0},
        "height": {"kp": 1.0, "ki": 0.1, "kd": 1.0, "error_scale": 2.0, "rate_scale": 2.0},
    },
}
HEADING: dict[str, dict[str, Group]] = {
    CLEAN: {
        LEADER: {"kp": 1.2, "ki": 0.5, "kd": 1.8, "error_scale": 0.1, "rate_scale": 0.1},
        FOLLOWER: {"kp": 1.0, "ki": 0.6, "kd": 0.1, "error_scale": 0.1, "rate_scale": 0.1},
    },
    NOISE: {LEADER: {"kp": 0.5, "ki": 0.1, "kd": 0.05, "error_scale": 0.1, "rate_scale": 0.1}},
}
PROTOCOL = "k1", "k2", "k3"
CONSENSUS: Group = dict(zip(PROTOCOL, (K1, K2, K3), strict=True))
FILTERS: dict[str, Group] = {
    CLEAN: {"derivative_filter_s": 0.1, "disturbance_observer_radps": 2.0},
    NOISE: {"derivative_filter_s": 1.0, "disturbance_observer_radps": 0.3},
}
DESIGNED_FILTERS = ("derivative_filter_s", "disturbance_observer_radps", "anti_windup_s")
SCALES = {"speed": 1.0, "heading": 0.1, "height": 2.0}
"""Mixed errors, and their rates, that count as 1 for the fuzzy scheduler."""
WEIGHTS = {"k_v": 0.0, "k_x": 1.0, "k_psi": 0.1, "k_y": 0.05, "k_z": 1.0}
SENSORS = 0.02, 0.03, 0.002
"""Least telemetry noise to design for, in position (m), airspeed (m/s) and heading (rad): the messages' resolution, and
the noise of an airspeed sensor."""
MINIMUM = 0.001
"""Lower bound of declared noise, m, m/s and rad."""


def gain_set(gains: str, frame: str) -> tuple[dict[str, Group], Group]:
    """Return the groups and the single keys that a set of gains fills, for a slot frame; `clean` for an unknown set."""
    known = gains if gains in GROUPS else CLEAN
    heading = HEADING[known].get(frame, HEADING[known][LEADER])
    return GROUPS[known] | {"heading": heading, "consensus": CONSENSUS}, FILTERS[known]


def designed(scenario: Scenario, given: Plain) -> Scenario:
    """Return a scenario with the law's gains by design, except those in `given`, its `law` as written."""
    written = given if isinstance(given, dict) else {}
    weights = WEIGHTS | _written(written, "mixer")
    channels, filters = design(*_known(scenario), weights, _delay_and_noise(scenario))
    filled = zip(DESIGNED_FILTERS, filters, strict=True)
    keys: dict[str, Any] = {name: value for name, value in filled if written.get(name) is None}
    keys["mixer"] = scenario.law.mixer.model_copy(update=weights)
    for name, channel in channels.items():
        scales = {"error_scale": SCALES[name], "rate_scale": SCALES[name]}
        gains = {"kp": channel.kp, "ki": channel.ki, "kd": channel.kd} | scales | _written(written, name)
        keys[name] = getattr(scenario.law, name).model_copy(update=gains)
    if scenario.law.type == "consensus" and any(each.model.airframe for each in scenario.vehicles):
        found = _protocol_gains(scenario) | _written(written, "consensus")
        keys["consensus"] = scenario.law.consensus.model_copy(update={name: found[name] for name in PROTOCOL})
    return scenario.on_same_path({"law": scenario.law.model_copy(update=keys)})


def _protocol_gains(scenario: Scenario) -> dict[str, float]:
    """Return k1, k2 and k3 of protocol (3) for the vehicles' responses and the graph."""
    vehicles, speed_mps = list[tuple[Axis, Axis]](), scenario.path.begin_mps
    for model in dict.fromkeys(each.model for each in scenario.vehicles):
        found = _responses(model, speed_mps)
        along = Axis.along(model.tau_v_s, found.speed)
        vehicles.append((along, Axis.across(model.tau_psi_s, found.heading, speed_mps)))
    weights, telemetry, links_s = scenario.adjacency, _delay_and_noise(scenario), 2.0 * design_delay_s(scenario)
    eigenvalues: list[complex] = np.linalg.eigvals(np.diag(weights.sum(axis=1)) - weights).tolist()
    gains = consensus_gains(vehicles, eigenvalues, telemetry.position_m, telemetry.delay_s - links_s, links_s)
    return dict(zip(PROTOCOL, gains, strict=True))


def redesigned(scenario: Scenario, delay_s: float) -> Scenario:
    """Return a scenario with its gains by design for links that take `delay_s` in each direction.

    Gains that differ from the design for the previous delay were given, and are kept.
    """
    law, mixer = scenario.law, plain_mapping(scenario.law.mixer.model_dump())
    before, given = designed(scenario, {"mixer": mixer}).law, Group({"mixer": mixer})
    for channel in CHANNELS:
        found, by_design = getattr(law, channel).model_dump(), getattr(before, channel).model_dump()
        given[channel] = Group({key: value for key, value in found.items() if not _same(value, by_design[key])})
    given |= {key: value for key in DESIGNED_FILTERS if not _same(value := getattr(law, key), getattr(before, key))}
    slower = law.model_copy(update={"design_delay_ms": 1e3 * delay_s})
    return designed(scenario.model_copy(update={"law": slower}), given)


def _same(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-12)


def figures(scenario: Scenario) -> Mapping[str, DesignedChannel]:
    """Return the properties of the law's gains by channel: bandwidths, margins, setpoint steps."""
    law = scenario.law
    vehicles, speed_mps = _known(scenario)
    gains = {name: (each.kp, each.ki, each.kd) for name in CHANNELS if (each := getattr(law, name))}
    return judged_channels(gains, vehicles, speed_mps, law.mixer.model_dump(), _delay_and_noise(scenario))


def by_design(scenario: Scenario) -> bool:
    """Return whether the channels' gains are designed, or should be because of the vehicles' airframes."""
    if scenario.law.type == "consensus":
        return False
    return scenario.law.gains == AUTO or any(each.model.airframe for each in scenario.vehicles)


def _known(scenario: Scenario) -> tuple[list[Responses], float]:
    """Return each kind of vehicle's responses, and the speed along the path."""
    speed_mps, kinds = scenario.path.begin_mps, list(dict.fromkeys(each.model for each in scenario.vehicles))
    return [_responses(each, speed_mps) for each in kinds], speed_mps


def _responses(model: VehicleModel, speed_mps: float) -> Responses:
    if model.airframe is None:
        return tau_responses(model.tau_v_s, model.tau_psi_s, (model.tau_ha_s, model.tau_hb_s))
    return airframe_responses(FREQUENCIES, model.airframe.parameters(), speed_mps)


def _delay_and_noise(scenario: Scenario) -> DelayAndNoise:
    """Return the longest loop delay to design for, dead time included, and the noise of the worst sensors."""
    dt_s, sample_s = 1.0 / scenario.law.rate_hz, 1.0 / scenario.telemetry.rate_hz
    dead_s = max(each.model.dead_time_s for each in scenario.vehicles)
    delay_s = 2.0 * design_delay_s(scenario) + dt_s / 2.0 + sample_s / 2.0 + dead_s
    kinds = dict.fromkeys((each.model, each.navigation) for each in scenario.vehicles)
    noise = [SENSORS]
    for model, keys in kinds:
        if isinstance(keys, NoisyNavigation):
            noise.append(_filtered_noise(keys, model, scenario.path.begin_mps, sample_s))
    return DelayAndNoise(dt_s, delay_s, *(max(each) for each in zip(*noise, strict=True)))


def design_delay_s(scenario: Scenario) -> float:
    """Return the links' delay in each direction that gains are designed for, s: half the longest configured round trip.

    Of several links of a vehicle the quickest counts, which it flies by.
    """
    round_trips_ms = (
        min(
            max(step.uplink.delay_ms + step.downlink.delay_ms for step in scenario.link_steps(vehicle, 1 + index))
            for index in range(len(vehicle.endpoints))
        )
        for vehicle in scenario.vehicles
    )
    return max(*round_trips_ms, 2.0 * scenario.law.design_delay_ms) / 2e3


def _filtered_noise(
    keys: NoisyNavigation, model: VehicleModel, speed_mps: float, sample_s: float
) -> tuple[float, float, float]:
    """Return the noise that remains of the declared noise after the station's filter, in the order of `SENSORS`."""
    round_rad = max(math.radians(keys.heading_sigma_deg), MINIMUM)
    position_m, velocity_mps = max(keys.position_sigma_m, MINIMUM), max(keys.velocity_sigma_mps, MINIMUM)
    _, speed_walk, heading_walk = UNMODELLED
    along = position_m, velocity_mps, max(keys.airspeed_sigma_mps, MINIMUM)
    across = position_m, velocity_mps, speed_mps * round_rad
    along_m, airspeed_mps = left_by_filter(along, speed_walk, model.tau_v_s, sample_s)
    across_m, swing_mps = left_by_filter(across, speed_mps * heading_walk, model.tau_psi_s, sample_s)
    return max(along_m, across_m), airspeed_mps, swing_mps / speed_mps


def _written(law: Mapping[Any, Plain], group: str) -> dict[str, Any]:
    keys = law.get(group)
    return {str(key): value for key, value in keys.items() if value is not None} if isinstance(keys, dict) else {}
