"""The laws that a scenario can name: one table, which holds all that differs between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flight_model.autopilot import AutopilotModel
from formation_scenario import Scenario
from formation_scenario import formation as keys
from formation_scenario.graph import scenario_adjacency
from gcs_formation.control.consensus import ConsensusLaw, ConsensusParameters
from gcs_formation.control.follower import LawParameters
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, Channel, FuzzyGainScheduler, GainRange, PidGains
from gcs_formation.control.law import FormationLaw
from gcs_formation.control.mixer import Mixer
from gcs_formation.control.situation import Law
from gcs_formation.control.velocity_law import VelocityController

LEAST_FILTER_S = 1e-6

Nominal = tuple[PidGains, PidGains, PidGains]
"""Of speed, heading and height."""


def nominal_gains(law: keys.Law) -> Nominal:
    """Return the gains that a scenario gives."""
    speed, heading, height = (
        PidGains(channel.kp, channel.ki, channel.kd, law.derivative_filter_s)
        for channel in (law.speed, law.heading, law.height)
    )
    return speed, heading, height


def both_ways(law: keys.Law) -> Nominal:
    """Return those of a law of velocities: across as along."""
    speed, _, height = nominal_gains(law)
    return speed, speed, height


def fuzzy_range(law: keys.Law) -> GainRange:
    """Return the range in which the fuzzy scheduler moves gains."""
    return GainRange(law.fuzzy.base, law.fuzzy.span)


def fixed(law: keys.Law) -> GainRange:  # noqa: ARG001 - whatever the scenario says
    """Return the range of gains that stay nominal."""
    return FIXED_GAINS


def law_parameters(scenario: Scenario) -> LawParameters:
    """Return the constants of a law in which each follows the leader by controllers of its own."""
    law, kind = scenario.law, law_kind(scenario)
    speed, heading, height = (
        Channel(
            PidGains(gains.kp, gains.ki, gains.kd, max(gains.filter_s, LEAST_FILTER_S)),
            channel.error_scale,
            channel.rate_scale,
            law.anti_windup_s,
        )
        for gains, channel in zip(kind.nominal(law), (law.speed, law.heading, law.height), strict=True)
    )
    gain_range = kind.gain_range(law)
    return LawParameters(
        mixer=Mixer(**law.mixer.model_dump()),
        frame=scenario.formation.frame,
        speed=speed,
        heading=heading,
        height=height,
        gain_range=gain_range,
        scheduler=None if gain_range is FIXED_GAINS else FuzzyGainScheduler(law.fuzzy.tables),
        gust_radps=law.disturbance_observer_radps,
    )


def formation_law(scenario: Scenario, models: list[AutopilotModel]) -> FormationLaw:
    """Return that law."""
    return FormationLaw(law_parameters(scenario), models)


def velocity_law(scenario: Scenario, models: list[AutopilotModel]) -> FormationLaw:
    """Return that law for vehicles that hover."""
    return FormationLaw(law_parameters(scenario), models, VelocityController)


def consensus_law(scenario: Scenario, models: list[AutopilotModel]) -> ConsensusLaw:
    """Return the consensus law, its graph in the order of the columns: that of the scenario's leader is 0."""
    law, followers = scenario.law.consensus, {each.vehicle_id: 1 + i for i, each in enumerate(scenario.followers)}
    columns = np.array([followers.get(vehicle.vehicle_id, 0) for vehicle in scenario.vehicles], dtype=np.intp)
    weights = np.zeros((1 + len(followers),) * 2)
    weights[np.ix_(columns, columns)] = scenario_adjacency(scenario)
    frame = scenario.formation.frame
    return ConsensusLaw(ConsensusParameters(law.k1, law.k2, law.k3, weights, sorted(columns.tolist()), frame), models)


@dataclass(frozen=True)
class LawKind:
    """What the commands need to know of a law."""

    name: str
    """As reports show it."""
    make: Callable[[Scenario, list[AutopilotModel]], Law]
    mutual: bool = False
    """Whether vehicles follow one another over the scenario's graph, the leader among them; else each the leader.

    Their states are then needed at one instant, and their loops are closed around all at once.
    """
    nominal: Callable[[keys.Law], Nominal] = nominal_gains
    gain_range: Callable[[keys.Law], GainRange] = fixed
    """Of its gains about the nominal ones."""
    variants: tuple[tuple[str, tuple[str, ...]], ...] = (("", ()),)
    """What `compare` flies of it: the ending of the name, and overrides in the manner of `--set`."""


PRINTED, SYMMETRIC = "law.fuzzy.tables=printed", "law.fuzzy.tables=symmetric"
LAWS: dict[keys.LawType, LawKind] = {
    "pid": LawKind("PID", formation_law),
    "fuzzy_pid": LawKind(
        "fuzzy PID",
        formation_law,
        gain_range=fuzzy_range,
        variants=(("", (PRINTED,)), ("_symmetric", (SYMMETRIC,))),
    ),
    "consensus": LawKind("consensus", consensus_law, mutual=True),
}


def law_kind(scenario: Scenario) -> LawKind:
    """Return what there is to know of the law that a scenario flies."""
    kind = LAWS[scenario.law.type]
    return replace(kind, make=velocity_law, nominal=both_ways) if scenario.hovers and not kind.mutual else kind
