"""What an autopilot and the body that it commands exchange in each step of its clock."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

from gcs_formation.errors import RunAbortedError
from sim_vehicles.airframe.rigid_body.motion import Quaternion, Vector


class ExchangeError(RunAbortedError):
    """An autopilot doesn't ask for what its sensors measure any more."""


class Sample(NamedTuple):
    """Motion and measurements at the end of a step; vectors of the Earth are north, east, down."""

    number: int
    """Of the step, from 1."""
    accel_mps2: Vector
    """Specific force in body axes."""
    gyro_rps: Vector
    position_m: Vector
    """From its home."""
    attitude: Quaternion
    """Quaternion from body to Earth axes, scalar part first."""
    velocity_mps: Vector
    airspeed_mps: float
    """True airspeed along its nose."""


class Exchange(ABC):
    """One autopilot's sensors and actuators."""

    step_s: float
    """How far each sample lets its clock go on, s: a whole number of microseconds, and of them in a cycle."""
    port: int
    """The port of this machine at which it asks."""
    has_ended: Callable[[], bool] = staticmethod(lambda: False)
    """Returns whether its process has ended, so that it isn't waited for."""

    @abstractmethod
    def outputs_us(self) -> tuple[int, ...]:
        """Return the pulses of its outputs, µs, once it has done all that the last sample made it do.

        Raises:
            ExchangeError: it doesn't ask.
        """

    @abstractmethod
    def answer(self, sample: Sample) -> None:
        """Give it what its sensors measure, which lets its clock go on by a step."""

    @abstractmethod
    def close(self) -> None:
        """Free the port."""
