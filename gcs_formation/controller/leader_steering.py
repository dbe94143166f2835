"""Steers the formation's leader: guidance and what is added to it, within the envelope, and what followers expect."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, Instant
from flight_model.autopilot_model import AutopilotModel, finite
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from formation_scenario import Scenario
from gcs_formation import from_scenario
from gcs_formation.control.finite import GUIDANCE, require_route, require_setpoint
from gcs_formation.control.law_interface import Lead
from gcs_formation.control.setpoint import Envelope
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.projection import States
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.extend.in_flight import OnTicks
from gcs_formation.guidance.lateral import TurnBounds, bend_max_rps2
from gcs_formation.guidance.leader_commands import LeaderCommand, LeaderCommands
from gcs_formation.guidance.slots import FormationPlan
from gcs_formation.guidance.turn_on_spot import NOSE_TAU_S
from gcs_formation.recorder import Tick


class LeaderSteering:
    """The leader's setpoint of each tick, and the commands of the last seconds, by which followers expect it to fly."""

    leader_m: float = math.nan
    """The height setpoint by which the leader would keep to its path in still air, whatever it says of its own."""

    max_mps: float = math.inf
    """Bound of its speed: what its followers can keep up with at present."""

    _turning: int | None = None
    _course_tau_s: float = math.nan
    """The index of a leader that turns on the spot, and the time constant of its course."""

    _decided_rad: float = math.nan
    """The leader's heading setpoint of the last tick, before a filter, the fence or the separation rule."""
    _commanded_rad: float = math.nan
    """The same after them."""

    def __init__(
        self, scenario: Scenario, plan: FormationPlan, models: list[AutopilotModel], history: SetpointHistory
    ) -> None:
        """Build guidance and what is added to it; the vehicles' `models` and the setpoints' `history` are shared."""
        self.guidance: Final = from_scenario.leader_guidance(scenario)
        self._own_guidance = from_scenario.own_guidance(scenario)
        self._steps = from_scenario.added_steps(scenario)
        self._plan, self._models, self._history = plan, models, history
        self._compensates = scenario.law.delay_compensation
        self._indices = list(range(len(models)))
        self._commands = LeaderCommands(1.0 / scenario.law.rate_hz)

    def hand_over(self) -> NotFiniteError | None:
        """Forget what was commanded, as another vehicle leads; return why a guidance from outside can't."""
        self.forget_steps()
        self._commands.drop_state()
        return None if self._own_guidance is None else self._own_guidance.reset()

    def forget_steps(self) -> None:
        """Forget the steps added to the leader's setpoints."""
        if self._steps is not None:
            self._steps.drop_state()

    def set_turn_time_constant(self) -> None:
        """Give a leader that turns on the spot the time constant of its yaw, and that of its course back later."""
        index = self._plan.leader if self.guidance.turn is not None else None
        if index != self._turning:
            if self._turning is not None:
                self._models[self._turning].tau_psi_s = self._course_tau_s
            if index is not None:
                self._course_tau_s, self._models[index].tau_psi_s = self._models[index].tau_psi_s, NOSE_TAU_S
            self._turning = index

    def before_filters(self, tick: Tick) -> None:
        """Note the leader's heading setpoint before something replaces it."""
        self._decided_rad = tick.setpoints[tick.leader][1]

    def after_all(self, tick: Tick) -> None:
        """Note the one that is sent."""
        self._commanded_rad = tick.setpoints[tick.leader][1]

    def turn_bounds(self, tick: Tick, slots_m: list[Vector3], sigma_rad: float) -> TurnBounds:
        """Return what bounds changes of the leader's turn rate: its followers, noise, and the delay of its link."""
        link = tick.links[tick.leader]
        round_trip_s = 2.0 * link.delay_s + link.dead_s if self._compensates and finite(link.delay_s) else 0.0
        return TurnBounds(bend_max_rps2(slots_m, self._models), sigma_rad, round_trip_s, link.loss * link.mean_gap)

    def steer(
        self,
        tick: Tick,
        states: States,
        turns: TurnBounds,
        outside: OnTicks | None,
        *,
        led: bool,
        assembled: bool,
    ) -> Lead:
        """Put the leader's setpoint into a tick; return how it goes on.

        Args:
            tick: this one.
            states: predicted to when setpoints act.
            turns: bounds of changes of its turn rate.
            outside: filters from outside, if the flight has any.
            led: whether it led at the last tick.
            assembled: whether the path may be begun.
        """
        at = Instant(states.instant(tick.leader))
        state, model = states.of(tick.leader, tick.leader), self._models[tick.leader]
        tick.state[tick.leader] = state
        if led:
            self._go_on_from_replaced(state, model)
        steered = state if self._steps is None else self._steps.without(state)
        wanted = self.guidance.steer(steered, model, assembled=assembled, bounds=turns, at=at)
        path, turn_rps = self.guidance.heading(state), self.guidance.turn_rps
        if self._own_guidance is not None:
            wanted = self._own_guidance.steer(self.guidance, wanted, steered, model)
            turn_rps = path.turn_rps + model.tau_psi_s * path.bend_rps2
        if self._steps is not None:
            self._steps.add(wanted, tick.mission_time_s, state, model)
        wanted.speed_mps = min(wanted.speed_mps, self.max_mps)
        turn = self.guidance.turn
        if turn is not None:
            wanted.heading_rad, turn_rps = turn.setpoint(at, model.tau_psi_s)
            self.forget_steps()
        self.leader_m = wanted.height_m + (model.tau_ha_s + model.tau_hb_s) * state.updraught_mps
        require_setpoint(GUIDANCE, tick.leader, (wanted.speed_mps, wanted.heading_rad, wanted.height_m))
        bounds = Envelope(wanted.heading_rad, state, model)
        commanded = bounds.limit(wanted.speed_mps, wanted.heading_rad, wanted.height_m)
        tick.setpoints[tick.leader] = commanded
        commanded = self._goes_on(tick.leader, commanded, outside)
        require_route(path, turn_rps, tick.leader)
        self._commands.add(at, LeaderCommand(commanded[0], commanded[1], commanded[2], turn_rps))
        self._plan.turn(tick.now / NANOSECONDS, turn_rps)
        compensates, history = self._compensates, self._commands
        commands = [history.at(states.instant(index) if compensates else at) for index in self._indices]
        return Lead(tick.leader, at, commands, path)

    def _go_on_from_replaced(self, state: FlightState, model: AutopilotModel) -> None:
        """Have the guidance go on from the last tick's heading setpoint where something replaced it."""
        if finite(self._commanded_rad) and self._commanded_rad != self._decided_rad:
            self.guidance.go_on_from(self._commanded_rad, self._decided_rad, state, model)
            self.forget_steps()

    def _goes_on(self, leader: int, commanded: Vector3, outside: OnTicks | None) -> Vector3:
        """Return with which command the law takes the leader to go on: the guidance's, unless filters replace it."""
        if outside is not None:
            commanded = outside.goes_on(commanded)
        self._history.of(leader).record(commanded)  # the law predicts the leader through it
        return commanded
