"""States and setpoints as code from outside sees them: plain values, which can be changed without an effect."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3


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
    slot_m: Vector3
    """Its slot: forward, right and up of the leader."""
    error_m: Vector3
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
    slots_m: tuple[Vector3, ...]
    """Its slots during the run: forward, right and up of the leader."""


class MeasuredVehicle(NamedTuple):
    """A vehicle's newest state at a tick, and what is known of its link, for predictors; times since the run began."""

    id: int | str | None
    """None: the virtual leader."""
    state: State
    """The newest state, estimated from its telemetry, at `stamp_s`."""
    stamp_s: float
    """When that was, s."""
    acts_s: float
    """When a setpoint sent now acts, s."""
    active: bool
    """Whether it is commanded."""
    by_model: Callable[[float], State]
    """Returns its state at a time by our own predictor: equation (7) through the setpoints in flight."""
    setpoint_at: Callable[[float], Setpoint]
    """Returns the setpoint that acts on it at a time; NaN before the first, and of the one that is made now."""


class RoundTrip(NamedTuple):
    """An answered TIMESYNC request, for estimators of the delay; times since the clock began, s."""

    sent_s: float
    received_s: float
    vehicle_s: float
    """The vehicle's clock, since it booted, when it answered."""
    loop_s: float
    """Period of the loop in which it answers: it waits half of that on average, which isn't the link's delay."""
    usual_s: tuple[float, float]
    """Delays up and down as our own estimator has them: half the mean round trip, and the asymmetry seen in steps."""


class RoutePoint(NamedTuple):
    """A point of the leader's route; north, east and height from the origin, m."""

    north_m: float
    east_m: float
    height_m: float
    course_rad: float
    """Direction over ground, clockwise from north."""
    curvature_1pm: float
    """Change of course along the route, rad/m, clockwise positive."""
    slope: float
    """Rise per metre."""


class GuidedLeader(NamedTuple):
    """The leader and its route, for guidance."""

    state: State
    """When its setpoint acts."""
    distance_m: float
    """Along the route, of the route's point nearest to it; on the path 0 is its start."""
    route: Callable[[float], RoutePoint]
    """Returns the route's point at a distance, m."""
    length_m: float
    """The route's."""
    on_path: bool
    """Whether the route is the path or its run-in; else it is a turn or a holding pattern that leads to it."""
    speed_mps: float
    """The airspeed to fly; 0 of a leader that hovers."""
    turn_rate_max_rps: float
    tau_psi_s: float
    """Time constant of its heading."""
    usual: Setpoint
    """What our own guidance commands."""
    dt_s: float
    """Time since the last tick, s."""


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
