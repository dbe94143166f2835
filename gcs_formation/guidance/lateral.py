"""The leader's lateral guidance: a heading setpoint that keeps it on its route, and never turns it by jerks.

What is decided is how fast the turn rate changes. A gust, or a bend that begins, acts on that at once; the turn rate
follows, then the heading, then the distance from the route. So the wind needs no filter of its own, and followers,
whose slots swing with the leader, get a turn rate that never jumps and changes no faster than they can follow.

The loop is a cascade of three gains: p/2 from distance to course, p from heading to turn rate, 2 p from turn rate to
its change. Its characteristic polynomial s^3 + 2 p s^2 + 2 p^2 s + p^3 is Butterworth's, the optimum of a quadratic
cost of distances and changes of the turn rate (B. D. O. Anderson, J. B. Moore, "Optimal Control", 1990). The course at
a distance is an arctangent, as in D. R. Nelson et al., "Vector field path following for miniature air vehicles", IEEE
Transactions on Robotics 23, 2007. The route's own turn and its rate are fed forward, for its curvature in the present
wind, through the inverse of model (7).
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from flight_model.autopilot_model import AutopilotModel, crab_rad, finite, rotated, signed, squared, within
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.guidance.rough_air import RoughAir

BANDWIDTH_RADPS: Final = 0.65
"""Highest bandwidth p of the loop without delay. Tuned: rad/s; 0.4 to 0.8; shown by `python -m
benchmarks.gust_grid`."""
DELAYED_RADPS: Final = 0.68
"""Highest bandwidth with delay, which is made up for by a higher one. At 300 ms, 0.72 would leave the leader of
four turbulent flights 1.27 m off its path (1.38 m at 0.65), 0.82 1.22 m; but then followers are up to 0.019 m off
after a step of 0.6 m/s at 500 ms, in place of 0.008 m. Tuned: rad/s; `BANDWIDTH_RADPS` to 0.8; shown by the flights
named here."""
ROUGH_NOISE_RATIO: Final = 3.0
"""The same in rough air, over that in calm air: gusts move setpoints anyway, and while one is being recognised the
course counts as noisy. In turbulence of a wind of 7 m/s p would fall to 0.48 again and again. Tuned: ratio; 2 to 5;
shown by `pytest tests/gcs_formation/guidance`."""
ROUGH_RATIO: Final = 1.25
"""Bandwidth in rough air, where followers' own gusts are larger than what they'd be spared, over that in calm air. In
turbulence of a wind of 7 m/s a simulated leader at 300 ms is 16 % less off its path; with 1.5 it would be 20 % less.
Tuned: ratio; 1 to 1.5; shown by the flights named here."""
GUST_MPS: Final = 1.0
"""A gust of this size may use up the change of turn rate that followers can keep up with, and no smaller one. Tuned:
m/s; 0.6 to 2; shown by `pytest tests/gcs_formation/guidance`."""
ACCELERATION_SHARE: Final = 0.7
"""Share of the followers' acceleration that a gust may use; the law needs the rest. Tuned: share; 0.5 to 0.9; shown by
`pytest tests/gcs_formation/guidance`."""
BEND_MAX_RPS2: Final = 0.15
"""How fast the turn rate of a leader without followers may change, besides the route's own bends. Tuned: rad/s²; 0.05
to 0.3; shown by `pytest tests/gcs_formation/guidance`."""
NOISE_RPS2: Final = 3e-4
"""Largest standard deviation that noise of the course, times p^2, may have: followers lead their speed by what it does
to the turn rate's change. `configs/noise.yaml` has setpoints as quiet as with a third of the bandwidth then. Tuned:
rad/s²; 1e-4 to 1e-3; shown by `gcs-formation run configs/noise.yaml`."""
HELD_UP_RADPS4: Final = 2e-3
"""Largest share of time in hold-ups, times p^4. A setpoint that is held up leaves the leader's heading, with which
slots swing, off by what it would have changed, in proportion to p^2. A loss of 5 % leaves p at 0.44; after a gust of
0.6 m/s followers are then 0.010 m off across (median of eight flights), and with 3.4e-3 0.012 m. Tuned: (rad/s)⁴; 1e-3
to 4e-3; shown by the flights named here."""
ROUTE_INTERCEPT_MAX_RAD: Final = math.radians(60.0)
"""Largest angle at which the route is intercepted. Tuned: rad; 0.7 to 1.2; shown by `pytest
tests/gcs_formation/guidance`."""
MIN_MPS: Final = 1.0
"""Lower bound of a speed that is divided by: a vehicle that can hover may have none."""
REFERENCE_RADPS: Final = 0.2
"""Rate at which the heading that setpoints lead from follows the predicted one: noise of headings is filtered, and what
the model doesn't know is forgotten. A vehicle whose time constant is wrong keeps a difference in every turn. Tuned:
rad/s; 0.1 to 0.5; shown by `pytest tests/gcs_formation/guidance`."""
TURNS_BACK_SHARE: Final = 0.5
"""Share of the angle to the route that could just be turned back before the route is crossed. Tuned: share; 0.3 to 0.8;
shown by `pytest tests/gcs_formation/guidance`."""
MANOEUVRE_RAD: Final = math.radians(15.0)
"""A heading setpoint that is farther from the one it replaces is a manoeuvre's. Tuned: rad; 0.1 to 0.5; shown by
`pytest tests/gcs_formation/guidance`."""
TWO_THIRDS: Final = 2.0 / 3.0
TINY: Final = 1e-9
NEAREST_SHARE: Final = 0.2
"""Lower bound of 1 - curvature × distance: nearer to a bend's centre the route's turn is no longer meaningful. Tuned:
share; 0.1 to 0.4; shown by `pytest tests/gcs_formation/guidance`."""
atan: Final = math.atan


@mypyc_attr(acyclic=True, free_list_len=1)
class TurnBounds:
    """What bounds the changes of a leader's turn rate."""

    def __init__(
        self,
        bend_max_rps2: float = BEND_MAX_RPS2,
        course_sigma_rad: float = 0.0,
        round_trip_s: float = 0.0,
        held_up: float = 0.0,
    ) -> None:
        """Take how fast the turn rate may change besides the route's own bends, the course's noise, and the delay.

        `held_up`: share of setpoints that are lost, times how many of them are lost in a row on average.
        """
        self.bend_max_rps2 = bend_max_rps2
        self.course_sigma_rad = course_sigma_rad
        self.round_trip_s = round_trip_s
        self.held_up = held_up

    def radps(self, speed_mps: float, rough: float = 0.0) -> float:
        """Return the bandwidth: the highest one, or with which noise, hold-ups and a gust keep to their bounds.

        `rough`: how rough the air is, 0 to 1.
        """
        followed = math.sqrt(self.bend_max_rps2 * speed_mps / (2.0 * GUST_MPS))
        noise_rps2 = NOISE_RPS2 * (1.0 + rough * (ROUGH_NOISE_RATIO - 1.0))
        quiet = math.sqrt(noise_rps2 / max(self.course_sigma_rad, TINY))
        held_up = math.sqrt(math.sqrt(HELD_UP_RADPS4 / max(self.held_up, TINY)))
        calm = self._delayed(min(BANDWIDTH_RADPS, followed))
        return min((1.0 + rough * (ROUGH_RATIO - 1.0)) * calm, quiet, held_up)

    def _delayed(self, radps: float) -> float:
        """Return the bandwidth with which a wind that grows steadily leads as far off the route as without delay.

        With a delay T, the wind is known T late. Growing by 1 m/s², it leads 2/p² + 2 T/p + T²/2 off the route.
        """
        late_s = self.round_trip_s
        minimum = 2.0 / squared(radps) - squared(late_s) / 2.0
        if minimum <= 0.0:
            return DELAYED_RADPS
        return min((late_s + math.sqrt(squared(late_s) + 2.0 * minimum)) / minimum, DELAYED_RADPS)


@mypyc_attr(acyclic=True, free_list_len=1)
class RouteTurn:
    """The turn rate of a vehicle along its route, and its rate of change, in the present wind."""

    def __init__(self, turn_rps: float, bend_rps2: float) -> None:
        """Take both."""
        self.turn_rps = turn_rps
        self.bend_rps2 = bend_rps2


def route_turn(point: PathPoint, state: FlightState, right_m: float) -> RouteTurn:
    """Return the turn of the heading that holds the route's curvature, `right_m` to the right of its nearest point.

    The heading is the course less the crab angle, which changes with the course even in constant wind.
    """
    carried_mps, crosswind_mps = rotated(point.course_rad, state.wind_north_mps, state.wind_east_mps)
    air_mps = math.sqrt(max(squared(state.airspeed_mps) - squared(crosswind_mps), squared(MIN_MPS)))
    over_mps = max(air_mps + carried_mps, 0.0) / max(1.0 - point.curvature_1pm * right_m, NEAREST_SHARE)
    course_rps = point.curvature_1pm * over_mps
    share = 1.0 + carried_mps / air_mps
    carried_mps2 = course_rps * crosswind_mps
    air_mps2 = carried_mps2 * carried_mps / air_mps
    share_rate = (carried_mps2 - air_mps2 * carried_mps / air_mps) / air_mps
    course_rps2 = point.curvature_rate_1pm2 * squared(over_mps) + point.curvature_1pm * (carried_mps2 + air_mps2)
    return RouteTurn(course_rps * share, course_rps2 * share + course_rps * share_rate)


class LateralGuidance:
    """The loop, with its state between ticks: the heading and the turn rate that its setpoints lead to."""

    def __init__(self, dt_s: float) -> None:
        """Begin with no vehicle steered; `dt_s` is the time between ticks."""
        self._dt_s = dt_s
        self._heading_rad = math.nan
        self._turn_rps = 0.0
        self._air = RoughAir(dt_s)
        self.setpoint_rps = 0.0
        """Rate of the heading setpoint when it acts: by (7), the turn rate plus the time constant times its change."""

    def drop_state(self) -> None:
        """Reset: another vehicle leads, or the leader hovers or turns on the spot."""
        self._heading_rad = math.nan
        self._air.drop_state()

    def go_on_from(self, commanded_rad: float, decided_rad: float, state: FlightState, model: AutopilotModel) -> None:
        """Go on from a heading setpoint that replaced the last one, which was `decided_rad`: it still acts.

        A filter's correction is continued. The turn of a manoeuvre isn't, which may be as fast as the vehicle can:
        braked as gently as followers like, it would lead the vehicle round, and their slots with it.
        """
        if abs(signed(commanded_rad - decided_rad)) > MANOEUVRE_RAD:
            self._heading_rad = math.nan
            return
        max_rps = model.turn_rate_max_rps
        self._heading_rad = state.heading_rad
        self._turn_rps = within(signed(commanded_rad - state.heading_rad) / model.tau_psi_s, -max_rps, max_rps)

    def setpoint_rad(
        self, point: PathPoint, state: FlightState, model: AutopilotModel, speed_mps: float, bounds: TurnBounds
    ) -> float:
        """Return the heading setpoint of this tick, rad.

        Args:
            point: of the route, nearest to the vehicle.
            state: the vehicle's when the setpoint acts.
            model: of its autopilot.
            speed_mps: airspeed to be flown; a vehicle that is to hover, at 0, faces along its route.
            bounds: of the changes of its turn rate.
        """
        if speed_mps == 0.0:
            return self._stand(point, state, model)
        north_m, east_m = state.north_m - point.north_m, state.east_m - point.east_m
        _, right_m = rotated(point.course_rad, north_m, east_m)
        route = route_turn(point, state, right_m)
        if math.isnan(self._heading_rad):
            self._heading_rad, self._turn_rps = state.heading_rad, route.turn_rps
        speed_mps, max_rps = max(speed_mps, MIN_MPS), model.turn_rate_max_rps
        self._air.observe(state.wind_north_mps, state.wind_east_mps)
        radps, bend_max_rps2 = bounds.radps(speed_mps, self._air.share), bounds.bend_max_rps2
        turn_rps = route.turn_rps + _turn_back_rps(point, state, right_m, speed_mps, radps, bend_max_rps2)
        back_rps2 = 2.0 * radps * (within(turn_rps, -max_rps, max_rps) - self._turn_rps)
        return self._follow(state, model, route.bend_rps2 + within(back_rps2, -bend_max_rps2, bend_max_rps2))

    def _stand(self, point: PathPoint, state: FlightState, model: AutopilotModel) -> float:
        """Return the setpoint along the route, and begin again when the vehicle flies on."""
        self.drop_state()
        north_mps, east_mps = state.ground_mps()
        along_mps, _ = rotated(point.course_rad, north_mps, east_mps)
        self.setpoint_rps = point.curvature_1pm * along_mps
        return point.course_rad - crab_rad(state, point.course_rad) + model.tau_psi_s * self.setpoint_rps

    def _follow(self, state: FlightState, model: AutopilotModel, bend_rps2: float) -> float:
        """Return the setpoint with which the turn rate changes at `bend_rps2`, within the vehicle's limit."""
        dt_s, before_rps, max_rps = self._dt_s, self._turn_rps, model.turn_rate_max_rps
        # Beyond its own time constant's worth of turning, a vehicle hasn't followed: it wasn't commanded for a while.
        max_rad, ahead_rad = model.tau_psi_s * max_rps, signed(self._heading_rad - state.heading_rad)
        self._heading_rad = state.heading_rad + within(ahead_rad, -max_rad, max_rad)
        self._turn_rps = within(before_rps + bend_rps2 * dt_s, -max_rps, max_rps)
        mean_rps = (before_rps + self._turn_rps) / 2.0
        # Held for a tick, this setpoint turns the vehicle by the mean rate times the tick, by (7).
        setpoint = self._heading_rad + model.held(dt_s).tau_psi_s * mean_rps
        self.setpoint_rps = before_rps + model.tau_psi_s * (self._turn_rps - before_rps) / dt_s
        self._heading_rad += (mean_rps + REFERENCE_RADPS * (state.heading_rad - self._heading_rad)) * dt_s
        return setpoint


def _turn_back_rps(
    point: PathPoint, state: FlightState, right_m: float, speed_mps: float, radps: float, bend_max_rps2: float
) -> float:
    """Return the turn rate towards the course that leads back to the route, besides the route's own turn.

    For a large angle it is the one that can be braked from before the vehicle has turned by it.
    """
    size_rad = min(atan(radps / 2.0 * abs(right_m) / speed_mps), ROUTE_INTERCEPT_MAX_RAD)
    # An angle a that is turned back at the bound b takes 2 (a/b)^1/2, and v a (a/b)^1/2 of distance.
    size_rad = min(size_rad, TURNS_BACK_SHARE * (abs(right_m) * math.sqrt(bend_max_rps2) / speed_mps) ** TWO_THIRDS)
    intercept = size_rad if right_m > 0.0 else -size_rad
    course = point.course_rad - intercept
    off_rad = signed(course - crab_rad(state, course) - state.heading_rad)
    size_rps = min(radps * abs(off_rad), math.sqrt(bend_max_rps2 * abs(off_rad)))
    return size_rps if off_rad > 0.0 else -size_rps


def bend_max_rps2(slots_m: list[Vector3], models: list[AutopilotModel]) -> float:
    """Return how fast a leader's turn rate may change for vehicles in their slots to keep up, rad/s².

    Args:
        slots_m: (C,) forward, right and up of the leader; NaN where there is none.
        models: (C,) of the vehicles.
    """
    max_rps2 = BEND_MAX_RPS2
    for slot, model in zip(slots_m, models, strict=False):
        if finite(slot[1]):
            max_rps2 = min(max_rps2, ACCELERATION_SHARE * model.accel_max_mps2 / max(abs(slot[1]), 1.0))
    return max_rps2
