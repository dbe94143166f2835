"""Base classes of parts of the station: what predicts the states, estimates the delays, and guides the leader."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from formation_scenario.extensions import DELAY_ESTIMATOR, GUIDANCE, PREDICTOR
from formation_scenario.register import Decorator, Extension, decorator
from gcs_formation.control.plain_values import GuidedLeader, MeasuredVehicle, RoundTrip


class Predictor(Extension, ABC):
    """Predicts the states that the law acts on, over the links' delays; there is one instance for a flight.

    Guidance and law get its states. Separation, conformance and estimators go on to use equation (7).
    """

    def take(self, vehicles: Sequence[MeasuredVehicle]) -> None:
        """Take a tick's newest states, the scenario's leader first, before the tick's predictions are asked for."""

    @abstractmethod
    def predict(self, vehicle: MeasuredVehicle, to_s: float, whose: MeasuredVehicle) -> Sequence[float]:
        """Return a vehicle's state at a time: a `State`, or its eight numbers in that order.

        Args:
            vehicle: whose state.
            to_s: when, s since the clock began: when the setpoint for `whose` acts.
            whose: the vehicle that is commanded by it: the same, or its follower.
        """


class DelayEstimator(Extension, ABC):
    """Estimates the delays of a vehicle's link, up and down; there is an instance for each vehicle.

    By the sum the delays that are compensated and compared with the margins are known, and by the asymmetry
    (difference) when a setpoint acts and when a state was measured.
    """

    vehicle: int | str
    """The vehicle's id."""

    @abstractmethod
    def measure(self, trip: RoundTrip) -> Sequence[float]:
        """Return the delays up and down, s, from now on: there is an answer to a request four times a second."""

    def reset(self) -> None:
        """Forget what was accumulated: the vehicle's clock has restarted."""


class LeaderGuidance(Extension, ABC):
    """Steers the leader along its route; there is one instance for a flight.

    Which route that is (turns before the path, the path, paths back to it), its speed and where the leader is on it
    stay ours, and so do the envelope, the fence, the ground and turns on the spot.
    """

    @abstractmethod
    def steer(self, leader: GuidedLeader) -> Sequence[float]:
        """Return speed m/s, heading rad and height m for the leader."""

    def reset(self) -> None:
        """Forget what was accumulated: another vehicle leads."""


def register_predictor(name: str) -> Decorator[type[Predictor]]:
    """Register a predictor, which `law.predictor.type: NAME` chooses; `law.predictor.parameters` are its keys."""
    return decorator(PREDICTOR, name, Predictor)


def register_delay_estimator(name: str) -> Decorator[type[DelayEstimator]]:
    """Register an estimator of delays, which `telemetry.clock: NAME` chooses; `telemetry.parameters` are its keys."""
    return decorator(DELAY_ESTIMATOR, name, DelayEstimator)


def register_guidance(name: str) -> Decorator[type[LeaderGuidance]]:
    """Register a guidance, which `path.guidance.type: NAME` chooses; `path.guidance.parameters` are its keys."""
    return decorator(GUIDANCE, name, LeaderGuidance)
