"""Keys of the formation: shape, frame of the slots, changes in flight; and of the law that keeps it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from formation_scenario import shapes
from formation_scenario.brought_keys import OpenGroup
from formation_scenario.fields import (
    MAX_NEAR_M,
    OF_AN_EXTENSION,
    Allowed,
    AtMost,
    Flag,
    Fraction,
    Frame,
    Keys,
    Later,
    NonNegative,
    Number,
    Offset,
    Open,
    OwnKeys,
    Positive,
    Rate,
    VehicleRef,
    key,
)
from formation_scenario.register import marks_of

CUSTOM: Final = "custom"
"""The shape whose slots are keys."""
SHAPE_NAMES: Final = (*(mark.name for mark in marks_of(shapes)), CUSTOM)
"""The shapes of `formation_scenario.shapes`, and that of `slots_m`; others come from extensions."""
ShapeName = Annotated[str, Open(", ".join(SHAPE_NAMES), SHAPE_NAMES)]
Slots = Mapping[VehicleRef, Offset]
Spacing = Annotated[Positive, Field(le=MAX_NEAR_M)]
MOST_MPS, MOST_DEG, MOST_M = 5.0, 45.0, 50.0
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


class FormationChange(Keys):
    """Another shape, spacing or leader, from a time on."""

    at_s: NonNegative = key(..., "when the change begins, s", 60)
    shape: ShapeName | None = key(None, "the new shape", "square", derived="the one before")
    parameters: OwnKeys = key(
        None, f"beside shape: {OF_AN_EXTENSION}", {}, derived="those before, else the formation's, for that shape"
    )
    spacing_m: Spacing | None = key(
        None, "the new spacing, m", 50, derived="with a shape formation.spacing_m, else the one before"
    )
    slots_m: Slots | None = key(
        None, "custom: the new slots, m", {2: [-40, 0, 0], 3: [-80, 0, 0], 4: [-120, 0, 0]}, derived="formation.slots_m"
    )
    leader: VehicleRef | None = key(None, "the vehicle that leads from then on", 3, derived="the one before")


class Formation(Keys):
    """Where each follower is to be."""

    shape: ShapeName = key(
        "diamond", "the shape at the start: one of these, or one that an extension registers", "arrow"
    )
    parameters: OwnKeys = key(None, f"beside shape: {OF_AN_EXTENSION}", {})
    spacing_m: Spacing = key(30.0, "unit of the shape, m; no two slots are nearer", 40)
    frame: Frame = key(
        "leader_heading",
        "frame of the slots and of the errors: as the leader heads, as each follower heads, or fixed: forward is north "
        "and right is east",
    )
    slots_m: Slots | None = key(
        None,
        "custom: by follower's id, forward, right and up of the leader, m",
        {2: [-30, 30, 0], 3: [-30, -30, 0], 4: [-60, 0, 5]},
    )
    succession: Literal["nearest", "none"] = key(
        "nearest", "who leads when the leader is lost: of the followers near it the one with the best link, or nobody"
    )
    changes: AtMost[Later[FormationChange]] = key(
        (),
        "later shapes, spacings and leaders",
        [{"at_s": 60, "shape": "square", "spacing_m": 50}, {"at_s": 100, "leader": 3}],
    )

    @property
    def slots_turn(self) -> bool:
        """Whether slots swing when the leader turns."""
        return self.frame != "north"


class Step(Keys):
    """What is added to the leader's setpoints for a while; its followers follow what it flies."""

    at_s: NonNegative = key(..., "when it begins, s", 20)
    for_s: Positive = key(..., "how long it lasts, s", 10)
    ramp_s: NonNegative = key(0.0, "duration of the ramp at its beginning, and again at its end, s", 5)
    speed_mps: Annotated[Number, Field(ge=-MOST_MPS, le=MOST_MPS)] = key(0.0, "added airspeed, m/s", 2)
    heading_deg: Annotated[Number, Field(ge=-MOST_DEG, le=MOST_DEG)] = key(0.0, "added heading, degrees", 15)
    height_m: Annotated[Number, Field(ge=-MOST_M, le=MOST_M)] = key(0.0, "added height, m", 8)


def added(steps: Sequence[Step], mission_time_s: float) -> tuple[float, float, float]:
    """Return the sum of all steps of speed (m/s), heading (rad) and height (m) setpoints; 0 before the path."""
    speed_mps = heading_deg = height_m = 0.0
    for step in steps:
        share = _share(step, mission_time_s - step.at_s)
        speed_mps += share * step.speed_mps
        heading_deg += share * step.heading_deg
        height_m += share * step.height_m
    return speed_mps, math.radians(heading_deg), height_m


def _share(step: Step, since_s: float) -> float:
    """Return the share of a step that is present; 0 for NaN, a time before the path."""
    if not 0.0 <= since_s <= step.for_s:
        return 0.0
    if step.ramp_s == 0.0:
        return 1.0
    return min(1.0, since_s / step.ramp_s, (step.for_s - since_s) / step.ramp_s)


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
        "who hears whom: a name, each undirected (in a star all hear the leader, and it all), or weights [p][q] > 0 "
        "where vehicle p hears q",
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
        "designed anew where a longer one is measured",
        300,
    )
    derivative_filter_s: NonNegative = _of_the_set("time constant of the derivative's filter, s", 0.5)
    anti_windup_s: Positive = key(1.0, "time constant of the back-calculation, s", 20)
    max_age_s: Positive = key(
        5.0,
        "oldest telemetry that is predicted from, s; beyond, the vehicle gets no setpoints and is told to loiter, at "
        "once if it is heard, after 30 s of silence if it isn't",
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
