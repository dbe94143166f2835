"""What the laws of one follower share: parameters, input, and a PID for each channel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

from mypy_extensions import mypyc_attr

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Slot, Vector3
from formation_scenario.fields import Frame
from gcs_formation.control.fuzzy_pid import NO_GAINS, ChannelConstants, FuzzyGainScheduler, Gains, Pid
from gcs_formation.control.outside import Feedback
from gcs_formation.control.setpoint import (
    LeaderMotion,
    Mixer,
    Replaced,
)

SLEW = (1.6, 1.04)
"""Largest growth rates of the speed and heading corrections, as shares of the acceleration and turn rate limits. Tuned:
share of the limit; 0.8 to 2; shown by `python -m benchmarks.effort_grid`."""
CLIMBING: Final = 0.35
"""Share of the climb limit: a height error that shrinks faster than this isn't integrated. Tuned: share of the climb
limit; 0.2 to 0.6; shown by `pytest tests/gcs_formation/control`."""


@dataclass(frozen=True)
class LawParameters:
    """The law's constants."""

    mixer: Mixer
    frame: Frame
    speed: ChannelConstants
    heading: ChannelConstants
    height: ChannelConstants
    scheduler: FuzzyGainScheduler | None
    """None for the plain PID: gains stay nominal."""
    gust_radps: float
    """Bandwidth of the filter by which a change of the drift is fed forward."""
    slew: tuple[float, float] = SLEW


@mypyc_attr(acyclic=True, free_list_len=1)
class LawInput:
    """A follower and its leader at the instant at which the follower's setpoint acts."""

    def __init__(
        self,
        leader: LeaderMotion,
        state: FlightState,
        slot: Slot,
        model: AutopilotModel,
        commanded: Vector3,
        wind_variance: float,
        bandwidth: list[float],
        replaced: Replaced,
    ) -> None:
        """Take the inputs of the law at one tick.

        Args:
            leader: how the leader flies.
            state: the follower's.
            slot: the follower's.
            model: the follower's `held` model, for setpoints that are constant during a tick.
            commanded: speed, heading and height setpoints that it follows at that instant; NaN where none.
            wind_variance: of each component of the difference of their winds, (m/s)².
            bandwidth: share of its full bandwidth for each loop.
            replaced: channels whose last setpoint was the separation rule's.
        """
        self.leader = leader
        self.state = state
        self.slot = slot
        self.model = model
        self.commanded = commanded
        self.wind_variance = wind_variance
        self.bandwidth = bandwidth
        self.replaced = replaced


class Controller(ABC):
    """The law of one follower, with its state between ticks and its last decision."""

    def __init__(self, parameters: LawParameters) -> None:
        """Start with empty integrators and filters, and no decision."""
        self._parameters, scheduler = parameters, parameters.scheduler
        self._forward = Pid(parameters.speed, scheduler)
        self._right = Pid(parameters.heading, scheduler)
        self._height = Pid(parameters.height, scheduler)
        self.feedback: Feedback | None = None
        """A law from outside, whose feedback replaces the PIDs'."""
        self.setpoint = self.error_m = self.mixed = UNKNOWN

    @property
    def gains(self) -> Gains:
        """The gains in force; NaN for a law from outside."""
        if self.feedback is not None:
            return NO_GAINS
        one, two, three = self._forward, self._right, self._height
        return one.kp, two.kp, three.kp, one.ki, two.ki, three.ki, one.kd, two.kd, three.kd

    def retune(self, parameters: LawParameters) -> None:
        """Use other gains and filters from now on."""
        self._parameters = parameters
        self._forward.retune(parameters.speed)
        self._right.retune(parameters.heading)
        self._height.retune(parameters.height)

    def reset(self) -> None:
        """Reset: the follower isn't commanded, or follows another leader."""
        self._forward.reset()
        self._right.reset()
        self._height.reset()
        if self.feedback is not None:
            self.feedback.reset()
        self.setpoint = self.error_m = self.mixed = UNKNOWN

    def _output(self, slopes: Vector3, right_share: float, pair: LawInput, dt_s: float) -> Vector3:
        """Return the feedback, which is added to the feed-forward; `slopes` are the mixed errors' rates of change.

        `right_share` scales the bandwidth of the second loop: rightward velocity, or heading.
        """
        bandwidth, mixed = pair.bandwidth, self.mixed
        if self.feedback is not None:
            return self.feedback.output(mixed, slopes, pair.replaced, dt_s)
        self._forward.filter_rate(slopes[0], dt_s)
        self._right.filter_rate(slopes[1], dt_s)
        self._height.filter_rate(slopes[2], dt_s)
        self._forward.schedule(mixed[0], bandwidth[0])
        self._right.schedule(mixed[1], bandwidth[1] * right_share)
        self._height.schedule(mixed[2], bandwidth[2])
        return self._forward.output(mixed[0]), self._right.output(mixed[1]), self._height.output(mixed[2])

    def _closes_fast(self, model: AutopilotModel) -> bool:
        """Return whether the height error shrinks at a rate near the vehicle's climb limit.

        On a long climb the limit sustains the error; an integral accumulated then would only be lost by overshooting.
        """
        maximum = CLIMBING * self._parameters.mixer.k_z * model.climb_max_mps
        return abs(self._height.rate) > maximum and self._height.rate * self.mixed[2] < 0.0

    @abstractmethod
    def decide(self, pair: LawInput, dt_s: float) -> None:
        """Compute the setpoint of this tick, which is `dt_s` after the last one."""
