"""States and setpoints as code from outside sees them: plain values, which can be changed without an effect."""

from __future__ import annotations

from typing import NamedTuple

from airlink.endpoint import VehicleId
from flight_model.autopilot_model import FlightState
from flight_model.slot import Triple


class State(NamedTuple):
    """A vehicle's state, predicted to the time when its setpoint acts: m, m/s, rad from north clockwise."""

    north_m: float
    east_m: float
    height_m: float
    airspeed_mps: float
    heading_rad: float
    climb_mps: float
    wind_north_mps: float
    wind_east_mps: float


class Setpoint(NamedTuple):
    """What a vehicle is commanded: airspeed m/s (multirotors: speed over ground), heading rad, height m."""

    speed_mps: float
    heading_rad: float
    height_m: float


class FollowerSlot(NamedTuple):
    """A follower as a law over all of them sees it; positions in m, north, east and up of the origin."""

    id: int | str
    state: State
    """Its own, when its setpoint acts."""
    leader: State
    """Its leader's at that time."""
    slot_m: Triple
    """Its slot: forward, right and up of the leader."""
    error_m: Triple
    """Its formation error: positive when it is behind, left of and below its slot."""
    speed_mps: tuple[float, float]
    """Lowest and highest speed that it can be commanded."""


class FollowerModel(NamedTuple):
    """A planned follower, for the delay margins of a law's loops around it."""

    id: int | str
    tau_v_s: float
    """Time constants of model (7): airspeed, heading, and the two of height."""
    tau_psi_s: float
    tau_ha_s: float
    tau_hb_s: float
    hovers: bool
    """Whether it is commanded by velocity over ground."""
    speed_mps: float
    """The path's airspeed at its start."""
    slots_m: tuple[Triple, ...]
    """Its slots during the run: forward, right and up of the leader."""


def plain_state(state: FlightState) -> State:
    """Return a state as plain values, which can be changed without an effect."""
    return State(
        state.north_m,
        state.east_m,
        state.height_m,
        state.airspeed_mps,
        state.heading_rad,
        state.climb_mps,
        state.wind_north_mps,
        state.wind_east_mps,
    )


def vehicle_name(identity: VehicleId) -> int | str:
    """Return a vehicle's id as a scenario writes it: a number, or "network:id" in another network than 1."""
    return identity.system if identity.network == 1 else str(identity)
