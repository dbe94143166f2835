"""What is in the air of an environment: its position and motion, and the air's velocity there."""

from __future__ import annotations

from abc import ABC, abstractmethod

from librt.strings import BytesWriter, write_f64_le

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState


class InAir(ABC):
    """A vehicle's motion as an environment and the record of ground truth know it."""

    def __init__(self, model: AutopilotModel, state: FlightState, wind_mps: tuple[float, float, float]) -> None:
        """Take what it is modelled as, its state, and the wind: north, east and down."""
        self.model = model
        self.state = state
        self.air_north_mps, self.air_east_mps, self.air_down_mps = wind_mps
        """Velocity of the air, with disturbances."""
        self.disturbance_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
        """Velocity of the air besides the wind: north, east, down."""

    @property
    @abstractmethod
    def airborne(self) -> bool:
        """Whether it is off the ground."""

    @abstractmethod
    def ground_velocity(self) -> tuple[float, float, float]:
        """Return ground velocity north, east and down, m/s."""

    def disturb(self, north_mps: float, east_mps: float, down_mps: float) -> None:
        """Add a velocity of the air."""
        north, east, down = self.disturbance_mps
        self.disturbance_mps = (north + north_mps, east + east_mps, down + down_mps)

    def write_truth(self, row: BytesWriter) -> None:
        """Append the values of `sim_vehicles.truth.QUANTITIES`, in their order."""
        state = self.state
        north_mps, east_mps, down_mps = self.ground_velocity()
        airborne = 1.0 if self.airborne else 0.0
        north, east, down = self.disturbance_mps
        write_f64_le(row, state.north_m)
        write_f64_le(row, state.east_m)
        write_f64_le(row, state.height_m)
        write_f64_le(row, north_mps)
        write_f64_le(row, east_mps)
        write_f64_le(row, -down_mps)
        write_f64_le(row, state.airspeed_mps)
        write_f64_le(row, state.heading_rad)
        write_f64_le(row, north * airborne)
        write_f64_le(row, east * airborne)
        write_f64_le(row, down * airborne)
        write_f64_le(row, airborne)
