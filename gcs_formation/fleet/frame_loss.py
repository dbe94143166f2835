"""The share of a vehicle's frames that are lost."""

from __future__ import annotations

from gcs_formation.vehicle.vehicle import Vehicle


class FrameLoss:
    """By the sequence numbers of the frames; a feature may know better."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Take whose frames."""
        self.vehicle = vehicle

    @property
    def loss(self) -> float:
        """Share that was lost in normal operation, without silences, 0 to 1."""
        return self.vehicle.sequence.loss

    @property
    def mean_gap(self) -> float:
        """Mean number of frames lost in a row, at least 1."""
        return self.vehicle.sequence.mean_gap

    @property
    def whole_loss(self) -> float:
        """Share that was lost, silences included, 0 to 1."""
        return self.vehicle.sequence.whole_loss
