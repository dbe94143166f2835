"""A law from outside that makes the setpoints of all followers at once."""

from __future__ import annotations

from typing import Any

from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Vector3, all_finite
from formation_scenario import Scenario
from formation_scenario.extensions import Registered
from formation_scenario.slot_assignment import ids_by_index
from formation_scenario.slot_frame import axis_rad
from gcs_formation.control.follower_loops import LawParameters
from gcs_formation.control.fuzzy_pid import NO_GAINS
from gcs_formation.control.law_interface import CycleInput, Law, LawOutput
from gcs_formation.control.outside import guarded, made, three_numbers
from gcs_formation.control.plain_values import FollowerSlot, plain_state, vehicle_name
from gcs_formation.control.setpoint import Envelope, formation_error
from gcs_formation.errors import NotFiniteError


class LawOverAll(Law):
    """Calls the law from outside, and keeps each setpoint within its vehicle's envelope."""

    def __init__(self, entry: Registered, scenario: Scenario, models: list[AutopilotModel]) -> None:
        """Make an instance; the (C,) `models` have the vehicles' limits.

        Raises:
            RunAbortedError: it can't begin.
        """
        self._entry, self._models, self._leader = entry, models, 0
        self._law: Any = made(entry, scenario.law.parameters)
        self._identities: list[VehicleId | None] = list(ids_by_index(scenario))
        self._frame = scenario.formation.frame

    def retune(self, parameters: LawParameters) -> None:
        """Keep its own gains."""

    def decide(self, cycle_input: CycleInput, dt_s: float) -> list[LawOutput]:
        """Return the followers' setpoints.

        Raises:
            NotFiniteError: the law raised an error, or returned no three finite numbers for a follower.
        """
        leader = cycle_input.lead.leader
        if leader != self._leader:
            self._leader = leader
            guarded(self._entry, self._law.reset)
        decided, seen = list[LawOutput](), list[FollowerSlot]()
        for index, identity in enumerate(self._identities):
            if index != leader and identity is not None:
                state, led, slot = (
                    cycle_input.states.of(index, index),
                    cycle_input.states.of(leader, index),
                    cycle_input.slots[index],
                )
                axis = axis_rad(self._frame, led.heading_rad, state.heading_rad)
                error_m = formation_error(led, state, slot, axis)
                decided.append(LawOutput(index, state, UNKNOWN, error_m, UNKNOWN, NO_GAINS))
                if cycle_input.active[index]:
                    speeds_mps = self._models[index].speed_min_mps, self._models[index].speed_max_mps
                    slot_m = slot.forward_m, slot.right_m, slot.up_m
                    name = vehicle_name(identity)
                    seen.append(FollowerSlot(name, plain_state(state), plain_state(led), slot_m, error_m, speeds_mps))
        found = guarded(self._entry, lambda: dict(self._law.setpoints(seen, dt_s)))
        for each in decided:
            if cycle_input.active[each.index]:
                each.setpoint = self._within(each.index, each.state, found)
        return decided

    def _within(self, index: int, state: FlightState, found: dict[Any, Any]) -> Vector3:
        identity = self._identities[index]
        assert identity is not None
        name, entry = vehicle_name(identity), self._entry
        wanted = entry.call(
            lambda: three_numbers(found[name]),
            lambda why: NotFiniteError(str(entry), None, f"no three numbers for vehicle {identity}: {why}"),
        )
        if not all_finite(wanted):
            values = f"speed {wanted[0]:.6g} m/s, heading {wanted[1]:.6g} rad, height {wanted[2]:.6g} m"
            raise NotFiniteError(f"{self._entry} ({self._entry.where})", index, f"setpoint: {values}")
        return Envelope(wanted[1], state, self._models[index]).limit(wanted[0], wanted[1], wanted[2])
