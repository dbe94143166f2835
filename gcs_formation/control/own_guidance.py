"""The leader's guidance from outside: it steers along the route that our own has planned."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.flight_state import Setpoint as Commanded
from flight_model.path import Route
from flight_model.slot import Vector3, all_finite
from formation_scenario.extensions import Registered
from gcs_formation.control.outside import guarded, made
from gcs_formation.control.plain_values import GuidedLeader, RoutePoint, Setpoint, plain_state
from gcs_formation.errors import NotFiniteError
from gcs_formation.guidance.leader_guidance import LeaderGuidance


class OwnGuidance:
    """Calls the guidance from outside at every tick."""

    def __init__(self, entry: Registered, keys: Mapping[str, Any], dt_s: float) -> None:
        """Make an instance; `dt_s` is the time between ticks.

        Raises:
            RunAbortedError: it can't begin.
        """
        self._entry, self._own, self._dt_s = entry, made(entry, keys), dt_s

    def steer(self, guidance: LeaderGuidance, usual: Commanded, state: FlightState, model: AutopilotModel) -> Commanded:
        """Return the leader's setpoint; `usual` is that of our own guidance, which knows the route and is steered on.

        Raises:
            NotFiniteError: it raised an error, or returned something else than three finite numbers.
        """
        route = guidance.route
        assert route is not None
        leader = GuidedLeader(
            plain_state(state),
            guidance.distance_m,
            partial(_point, route),
            route.length_m,
            guidance.on_path,
            guidance.speed_mps,
            model.turn_rate_max_rps,
            model.tau_psi_s,
            Setpoint(usual.speed_mps, usual.heading_rad, usual.height_m),
            self._dt_s,
        )

        def setpoint() -> Vector3:
            speed_mps, heading_rad, height_m = self._own.steer(leader)
            return float(speed_mps), float(heading_rad), float(height_m)

        found = guarded(self._entry, setpoint)
        if not all_finite(found):
            values = "speed {:.6g} m/s, heading {:.6g} rad, height {:.6g} m".format(*found)
            raise NotFiniteError(f"{self._entry} ({self._entry.where})", None, f"setpoint: {values}")
        return Commanded(*found)

    def reset(self) -> NotFiniteError | None:
        """Forget what was accumulated, as another vehicle leads; return the error if that fails."""
        try:
            guarded(self._entry, self._own.reset)
        except NotFiniteError as error:
            return error
        return None


def _point(route: Route, distance_m: float) -> RoutePoint:
    at = route.at(distance_m)
    return RoutePoint(at.north_m, at.east_m, at.height_m, at.course_rad, at.curvature_1pm, at.slope)
