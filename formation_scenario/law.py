"""Keys of the law that keeps the formation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from formation_scenario.brought_keys import OpenGroup
from formation_scenario.fields import (
    OF_AN_EXTENSION,
    Allowed,
    Flag,
    Fraction,
    Keys,
    Later,
    NonNegative,
    Open,
    OwnKeys,
    Positive,
    Rate,
    key,
)

GraphWeights = tuple[tuple[NonNegative, ...], ...]
Graph = Annotated[
    Literal["star", "path", "ring", "complete"] | GraphWeights,
    Allowed("star, path, ring, complete, or a square list of weights >= 0", ("star", "path", "ring", "complete")),
]
RuleRow = Annotated[tuple[Fraction, ...], Field(min_length=5, max_length=5), Allowed("5 numbers from 0 to 1")]
RuleTable = Annotated[
    tuple[RuleRow, ...],
    Field(min_length=5, max_length=5),
    Allowed("5 rows of 5 numbers from 0 to 1: a row for each set of the error's rate, a column for each of the error"),
]
LAW_TYPES = "fuzzy_pid", "pid", "consensus"
"""The laws of `gcs_formation.control.laws`; others come from extensions."""
LawType = Annotated[str, Open(", ".join(LAW_TYPES), LAW_TYPES)]
PREDICTORS: Final = ("model",)
"""The predictors of `gcs_formation.control.predictors`; others come from extensions."""
PredictorType = Annotated[str, Open(", ".join(PREDICTORS), PREDICTORS)]
OF_THE_SET = "of the set that law.gains names"
K1, K2, K3 = 0.1, 0.6, 0.25
"""Gains of the consensus protocol for vehicles that fly by equation (7)."""


def _of_the_set(description: str, example: float) -> Any:  # noqa: ANN401 - as pydantic types the defaults of fields
    """Return the field of a key whose default comes from the set of gains."""
    return key(..., description, example, derived=OF_THE_SET)


class Mixer(Keys):
    """Weights of the mixed errors (equation 13)."""

    k_v: NonNegative = _of_the_set("weight of the speed difference, m/s, in the mixed speed error", 0.5)
    k_x: NonNegative = _of_the_set("weight of the forward error, m, in the mixed speed error", 0.5)
    k_psi: NonNegative = _of_the_set("weight of the heading difference, rad, in the mixed heading error", 0.2)
    k_y: NonNegative = _of_the_set("weight of the lateral error, m, in the mixed heading error", 0.02)
    k_z: NonNegative = _of_the_set("weight of the height error, m, in the mixed height error", 0.8)


class PidGains(Keys):
    """Nominal gains of one channel and the ranges of the fuzzy scheduler's inputs."""

    kp: NonNegative = _of_the_set("proportional gain", 1.5)
    ki: NonNegative = _of_the_set("integral gain, 1/s", 0.2)
    kd: NonNegative = _of_the_set("derivative gain, s", 1)
    error_scale: Positive = _of_the_set("mixed error that counts as 1", 2)
    rate_scale: Positive = _of_the_set("rate of the mixed error that counts as 1, 1/s", 2)


class Fuzzy(Keys):
    """Range of the fuzzy scheduler: gain = (base + span·F)·nominal, F in [0, 1]."""

    base: NonNegative = key(0.7, "share of the nominal gain at F = 0", 0.8)
    span: NonNegative = key(0.6, "share of the nominal gain that F = 1 adds", 0.4)
    tables: Literal["printed", "symmetric"] = key(
        "printed", "the rule tables: as they are, by default as the paper prints them, or made symmetric"
    )
    table_p: RuleTable | None = key(
        None,
        "rules of kp in place of the paper's: F for negative high, negative low, zero, positive low and positive high "
        "rates (rows) and errors (columns); the paper's ZR, PL, PH are 0, 0.5, 1",
        [[0, 0, 1, 0, 0]] * 5,
        derived="the paper's",
    )
    table_i: RuleTable | None = key(None, "the same of ki", [[0, 0, 1, 0, 0]] * 5, derived="the paper's")
    table_d: RuleTable | None = key(None, "the same of kd", [[0, 0, 1, 0, 0]] * 5, derived="the paper's")


def _of_the_protocol(default: float, description: str, example: float) -> Any:  # noqa: ANN401 - as above
    """Return the field of a gain of protocol (3)."""
    derived = f"{default:g}; by design with gains: auto and any model with an airframe"
    return key(..., description, example, derived=derived)


class Consensus(Keys):
    """Gains and graph of the consensus protocol (equation 3)."""

    k1: NonNegative = _of_the_protocol(K1, "gain on positions, 1/s²", 0.05)
    k2: NonNegative = _of_the_protocol(K2, "gain on velocities, 1/s", 0.5)
    k3: NonNegative = _of_the_protocol(K3, "gain on the formation's velocity; 1/tau of it is the autopilot's, 1/s", 0.5)
    graph: Graph = key(
        "star",
        "who receives from whom: a name, each undirected (in a star all receive from the leader, and it from all), "
        "or weights [p][q] > 0 where vehicle p receives from q",
        "ring",
    )


class OwnPredictor(Keys):
    """What predicts the states over the links' delays."""

    type: PredictorType = key(
        PREDICTORS[0],
        "model: equation (7) through the setpoints in flight; or one that an extension registers",
        "smith",
    )
    parameters: OwnKeys = key(None, OF_AN_EXTENSION, {})


class Law(OpenGroup, group="law"):
    """The control law and its parameters."""

    type: LawType = key("fuzzy_pid", "the law: one of these, or one that an extension registers", "consensus")
    rate_hz: Rate = key(10.0, "control ticks a second, Hz", 20)
    delay_compensation: Flag = key(True, "predict the states over the links' delays")
    predictor: Later[OwnPredictor] | None = key(None, "with delay_compensation: by what they are predicted")
    gains: Literal["auto", "clean", "noise"] = key(
        ...,
        "set of gains that fills what isn't given of mixer, speed, heading, height, derivative_filter_s "
        "and disturbance_observer_radps; auto: by design, from the vehicles' models, links and noise",
        "noise",
        derived="auto if any vehicle's model has an airframe or is a file's, else noise if any vehicle's navigation is "
        "noisy, else clean",
    )
    design_delay_ms: Annotated[NonNegative, Field(le=5000.0)] = key(
        0.0,
        "delay of the links each way for which gains: auto are designed, where `links` has less, ms; gains are "
        "designed again where a longer one is measured",
        300,
    )
    derivative_filter_s: NonNegative = _of_the_set("time constant of the derivative's filter, s", 0.5)
    anti_windup_s: Positive = key(1.0, "time constant of the back-calculation, s", 20)
    max_age_s: Positive = key(
        5.0,
        "oldest telemetry that is predicted from, s; beyond, the vehicle gets no setpoints and is commanded to loiter, "
        "at once if it is heard, after 30 s of silence if it isn't",
        3,
    )
    disturbance_observer_radps: NonNegative = _of_the_set(
        "bandwidth of the disturbance observer, rad/s; 0 switches it off", 0.5
    )
    mixer: Mixer = key(..., "weights of the mixed errors", derived=OF_THE_SET)
    speed: PidGains = key(..., "forward channel", derived=OF_THE_SET)
    heading: PidGains = key(..., "lateral channel; defaults depend on formation.frame too", derived=OF_THE_SET)
    height: PidGains = key(..., "height channel", derived=OF_THE_SET)
    fuzzy: Fuzzy = Fuzzy()
    consensus: Consensus = key(..., "", derived="its keys'")
    parameters: Annotated[Mapping[str, Any], Allowed("a mapping of the law's own keys")] = key(
        {}, "keys of a law that an extension registers", {"k": 1.2}
    )
