"""Identities of vehicles: as MAVLink has only 254 system ids per network, a vehicle is named by both."""

from typing import NamedTuple


class VehicleId(NamedTuple):
    """A vehicle's identity: the MAVLink network it is heard on, and its system id there."""

    network: int
    system: int

    def __str__(self) -> str:
        """Return the system id alone on the first network, "network:system" elsewhere."""
        return str(self.system) if self.network == 1 else f"{self.network}:{self.system}"
