"""Checks that what a predictor, the guidance or a law returns is finite, before limits could hide that it isn't."""

from __future__ import annotations

from typing import Final

from flight_model.flight_state import FlightState
from flight_model.slot import Slot, Vector3, all_finite
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.projection import States
from gcs_formation.guidance.tracking import RouteHeading

PREDICTOR: Final = "predictor"
GUIDANCE: Final = "guidance"
LAW: Final = "law"
"""The parts of a control cycle whose output is checked."""
STATE: Final = (
    "north (m)",
    "east (m)",
    "height (m)",
    "climb (m/s)",
    "airspeed (m/s)",
    "heading (rad)",
    "wind north (m/s)",
    "wind east (m/s)",
    "updraught (m/s)",
)
SETPOINT: Final = "airspeed (m/s)", "heading (rad)", "height (m)"
ROUTE: Final = (
    "turn (rad/s)",
    "heading (rad)",
    "its rate (rad/s)",
    "the rate of that (rad/s²)",
    "climb (m/s)",
    "speed (m/s)",
)
POSITION: Final = "forward (m)", "right (m)", "up (m)"
MOTION: Final = (*POSITION, *(f"{axis} ({unit})" for unit in ("m/s", "m/s²") for axis in ("forward", "right", "up")))


def is_finite(state: FlightState) -> bool:
    """Return whether no value of a state is NaN or infinite."""
    total = state.north_m + state.east_m + state.height_m + state.climb_mps + state.airspeed_mps + state.heading_rad
    total += state.wind_north_mps + state.wind_east_mps + state.updraught_mps
    return total - total == 0.0


class FiniteStates(States):
    """A predictor's states; one that isn't finite is an error."""

    def __init__(self, states: States) -> None:
        """Take the predictor's output of a tick."""
        self._states = states

    def of(self, which: int, whose: int) -> FlightState:
        """Return a vehicle's state, as predicted.

        Raises:
            NotFiniteError: a value of it is NaN or infinite, or can't be computed.
        """
        try:
            state = self._states.of(which, whose)
        except (ArithmeticError, ValueError) as error:
            raise NotFiniteError(PREDICTOR, None, f"{type(error).__name__}: {error}") from error
        if not is_finite(state):
            raise NotFiniteError(PREDICTOR, which, f"state: {_listed(STATE, list(state.values()))}")
        return state

    def instant(self, whose: int) -> int:
        """Return the instant used for a vehicle's setpoint, ns."""
        return self._states.instant(whose)


def require_setpoint(part: str, index: int, setpoint: Vector3) -> None:
    """Raise NotFiniteError if a setpoint isn't finite: airspeed m/s, heading rad and height m."""
    if not all_finite(setpoint):
        raise NotFiniteError(part, index, f"setpoint: {_listed(SETPOINT, list(setpoint))}")


def require_route(path: RouteHeading, turn_rps: float, leader: int) -> None:
    """Raise NotFiniteError if how a leader's route continues, or its commanded turn rate, isn't finite."""
    total = turn_rps + path.heading_rad + path.turn_rps + path.bend_rps2 + path.climb_mps + path.along_mps
    if total - total != 0.0:
        values = [turn_rps, path.heading_rad, path.turn_rps, path.bend_rps2, path.climb_mps, path.along_mps]
        raise NotFiniteError(GUIDANCE, leader, f"route: {_listed(ROUTE, values)}")


def require_slots(slots: list[Slot], active: list[bool]) -> None:
    """Raise NotFiniteError if the position or the motion of an active vehicle's slot isn't finite."""
    for index, slot in enumerate(slots):
        total = slot.forward_m + slot.right_m + slot.up_m + slot.forward_mps + slot.right_mps + slot.up_mps
        total += slot.forward_mps2 + slot.right_mps2 + slot.up_mps2
        if active[index] and total - total != 0.0:
            values = [slot.forward_m, slot.right_m, slot.up_m, slot.forward_mps, slot.right_mps, slot.up_mps]
            values += [slot.forward_mps2, slot.right_mps2, slot.up_mps2]
            raise NotFiniteError(GUIDANCE, index, f"slot: {_listed(MOTION, values)}")


def require_decision(decided: LawOutput, leader: int) -> None:
    """Raise NotFiniteError if a law's setpoint or, of a follower, its error isn't finite."""
    require_setpoint(LAW, decided.index, decided.setpoint)
    if decided.index != leader and not all_finite(decided.error_m):
        raise NotFiniteError(LAW, decided.index, f"error: {_listed(POSITION, list(decided.error_m))}")


def _listed(names: tuple[str, ...], values: list[float]) -> str:
    """Return values behind their names."""
    return ", ".join(f"{name} {value:.6g}" for name, value in zip(names, values, strict=True))
