"""Keys of the control law. The default gains suit the default vehicle model, with or without noise in telemetry."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.fields import Allowed, Flag, Keys, NonNegative, Positive, Rate

GraphWeights = tuple[tuple[NonNegative, ...], ...]
Graph = Annotated[
    Literal["star", "path", "ring", "complete"] | GraphWeights,
    Allowed("star, path, ring, complete, or a square list of weights >= 0", ("star", "path", "ring", "complete")),
]


class Mixer(Keys):
    """Weights of the mixed errors (equation 13)."""

    k_v: NonNegative = Field(description="speed difference, m/s -> mixed speed error")
    k_x: NonNegative = Field(description="forward error, m -> mixed speed error")
    k_psi: NonNegative = Field(description="heading difference, rad -> mixed heading error")
    k_y: NonNegative = Field(description="lateral error, m -> mixed heading error")
    k_z: NonNegative = Field(description="height error, m -> mixed height error")


class PidGains(Keys):
    """Nominal gains of one channel and the ranges of the fuzzy scheduler's inputs."""

    kp: NonNegative = Field(description="proportional gain")
    ki: NonNegative = Field(description="integral gain, 1/s")
    kd: NonNegative = Field(description="derivative gain, s")
    error_scale: Positive = Field(description="mixed error that counts as 1")
    rate_scale: Positive = Field(description="rate of the mixed error that counts as 1, 1/s")


class Fuzzy(Keys):
    """Range of the fuzzy scheduler: gain = (base + span·F)·nominal, F in [0, 1]."""

    base: NonNegative = Field(default=0.7, description="share of the nominal gain at F = 0")
    span: NonNegative = Field(default=0.6, description="share of the nominal gain that F = 1 adds")
    tables: Literal["printed", "symmetric"] = Field(default="printed", description="printed | symmetric")


class Consensus(Keys):
    """Gains and graph of the consensus protocol (equation 3)."""

    k1: NonNegative = Field(default=0.1, description="position, 1/s²")
    k2: NonNegative = Field(default=0.6, description="velocity, 1/s")
    k3: NonNegative = Field(default=0.25, description="velocity of the formation, 1/s; 1/tau of it is the autopilot's")
    graph: Graph = Field(default="star", description="a name, or weights [p][q] > 0 where vehicle p hears q")


class Law(Keys):
    """The control law and its parameters."""

    type: Literal["fuzzy_pid", "pid", "consensus"] = Field(default="fuzzy_pid", description="the law")
    rate_hz: Rate = Field(default=10.0, description="control ticks a second, Hz")
    delay_compensation: Flag = Field(default=True, description="predict the states over the links' delays")
    on_delay: Literal["degrade", "hold", "warn"] = Field(
        default="warn",
        description="when a loop's delay nears its margin: degrade (gains come down until it holds), hold, warn",
    )
    gains: Literal["clean", "noise"] = Field(
        description="set of gains that fills what isn't given of mixer, speed, heading, height, derivative_filter_s "
        "and disturbance_observer_radps: clean | noise; default: noise if any vehicle's navigation is noisy"
    )
    derivative_filter_s: NonNegative = Field(description="time constant of the derivative's filter, s")
    anti_windup_s: Positive = Field(default=1.0, description="time constant of the back-calculation, s")
    max_age_s: Positive = Field(
        5.0, description="oldest telemetry that is predicted from, s; beyond, the vehicle is told to loiter"
    )
    disturbance_observer_radps: NonNegative = Field(
        description="bandwidth of the disturbance observer, rad/s; 0 switches it off"
    )
    mixer: Mixer = Field(description="mixed errors")
    speed: PidGains = Field(description="forward channel")
    heading: PidGains = Field(description="lateral channel; defaults depend on formation.frame too")
    height: PidGains = Field(description="height channel")
    fuzzy: Fuzzy = Fuzzy()
    consensus: Consensus = Consensus()
