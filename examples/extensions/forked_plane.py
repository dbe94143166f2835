"""A family of autopilots: a fork of ArduPlane that names itself a VTOL, and takes heights in steps alone."""

from collections.abc import Mapping

from pydantic import BaseModel, Field

from gcs_formation.extend import register_autopilot
from gcs_formation.extend.autopilots import ArduPlane, FlightState, Heartbeat, Setpoint, StartUpStep

TYPES = 1, 20, 22  # MAV_TYPE_FIXED_WING, MAV_TYPE_VTOL_QUADROTOR, MAV_TYPE_VTOL_FIXEDROTOR


@register_autopilot("forked_plane")  # vehicles: [{id: 2, autopilot: forked_plane, parameters: {height_step_m: 5}}]
class ForkedPlane(ArduPlane):
    """Is recognised by its heartbeat, armed as its kin after a look at its battery, and commanded in steps."""

    family = "forked plane"

    class Keys(BaseModel):
        """`parameters` of the vehicle."""

        height_step_m: float = Field(default=1.0, gt=0.0)

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is from it."""
        return heartbeat.type in TYPES

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps to follow setpoints in the air: messages, a look at its battery, and what its kin needs."""
        asks, *rest = super().start_up(rates_hz)
        seen = StartUpStep("waited for its battery's state", lambda telemetry: telemetry.complete, timeout_s=10.0)
        return (asks, seen, *rest)

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple:
        """Return the messages of a setpoint, its height in steps."""
        return super().setpoint(self.stepped(setpoint), where)

    def changed(self, setpoint: Setpoint, where: FlightState, known: list) -> list:
        """Return those of them that differ from the ones that it knows."""
        return super().changed(self.stepped(setpoint), where, known)

    def stepped(self, setpoint: Setpoint) -> Setpoint:
        """Return a setpoint whose height is a multiple of the step."""
        step_m = self.keys.height_step_m
        return Setpoint(setpoint.speed_mps, setpoint.heading_rad, step_m * round(setpoint.height_m / step_m))
