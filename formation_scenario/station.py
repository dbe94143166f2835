"""Who the ground station is on the wire."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from airlink.endpoint import ComponentId
from formation_scenario.fields import WHOLE, Allowed, Keys, key

MavlinkId = Annotated[int, Field(strict=True, ge=1, le=255), WHOLE, Allowed("a whole number from 1 to 255")]


class StationId(Keys):
    """The ground station's MAVLink ids.

    Component ids from 25 to 99 are a user's own (MAVLink, MAV_COMPONENT). Vehicles answer a command to the ids of its
    sender, so two ground stations that share both take each other's answers for their own.
    """

    system: MavlinkId = key(255, "system id; a vehicle's GCS failsafe expects it (MAV_GCS_SYSID)", 250)
    component: MavlinkId = key(25, "component id; QGroundControl and Mission Planner have 190, MAVProxy 230", 26)

    @property
    def ids(self) -> ComponentId:
        """Both ids."""
        return ComponentId(self.system, self.component)
