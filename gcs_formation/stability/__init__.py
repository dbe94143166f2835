"""Delay margins of a scenario's law: how much delay each loop closed over the link can have before it is unstable."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from operator import itemgetter

from airlink.endpoint import VehicleId
from flight_model.energy import AirframeParameters
from flight_model.frequency_response import FREQUENCIES, airframe_responses, tau_responses
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import planned_slots
from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import PidGains
from gcs_formation.control.laws import gain_range, law_kind, nominal_gains
from gcs_formation.control.setpoint import TRAIL_S, Mixer
from gcs_formation.stability.consensus_loops import consensus_delay_margin, ground_consensus_loops
from gcs_formation.stability.mismatch import LoopDelay, Usage
from gcs_formation.stability.pid_margins import (
    SMALL_SIGNAL,
    AircraftResponse,
    Loop,
    Plant,
    forward_plant,
    height_plant,
    less_dead_time,
    loop_delay_s,
    loop_margin,
    right_plant,
    worst_loop_margin,
)
from gcs_formation.stability.stated import Stated, stated_margins, usages

__all__ = [
    "LawMargins",
    "LoopDelay",
    "Usage",
    "consensus_delay_margin",
    "law_loops",
    "law_margins",
    "law_usages",
    "loop_delay_s",
    "scenario_delay_margin",
]

TAUS = "tau_v_s", "tau_psi_s"
"""Lags of the axes on which the consensus law closes loops: along the heading, and across."""
Axes = tuple[AircraftResponse, AircraftResponse, AircraftResponse] | tuple[None, None, None]


@dataclass(frozen=True, slots=True)
class LawMargins:
    """Margin of each loop by its name, s: at zero error, and the smallest over all gains that the law can schedule.

    They are for loops without prediction and without wind observer; 0 or less means unstable without delay.
    """

    small_signal: Mapping[str, float]
    worst: Mapping[str, float]


def follower_margins(scenario: Scenario) -> dict[VehicleId, LawMargins]:
    """Return the delay margins of the loops x, y and z around every vehicle that is a follower at some time.

    A follower's margin is the least over its slots during the run, at the speed along the path. The scenario's leader
    counts as a follower if another vehicle is planned to lead.
    """
    gains_range, nominal = gain_range(scenario), nominal_gains(scenario)

    @cache
    def axis(gains: PidGains, plant: Plant, aircraft: AircraftResponse | None, dead_s: float) -> tuple[float, float]:
        min_s = loop_margin(gains, plant, gains_range, aircraft=aircraft)
        worst_s = worst_loop_margin(gains, plant, gains_range, aircraft)
        return less_dead_time(min_s, dead_s), less_dead_time(worst_s, dead_s)

    def margins(model: VehicleModel, x_rc_m: float) -> LawMargins:
        plants, aircraft = _plants(scenario, model, x_rc_m), aircraft_responses(model, scenario.path.begin_mps)
        loops, dead_s = zip("xyz", nominal, plants, aircraft, strict=True), model.dead_time_s
        axes = {name: axis(*loop, dead_s) for name, *loop in loops}
        return LawMargins(*({name: each[which] for name, each in axes.items()} for which in (0, 1)))

    return {
        identity: _min([margins(model, x_rc_m) for x_rc_m in positions_m])
        for identity, model, positions_m in _planned(scenario)
    }


def leader_loops(scenario: Scenario) -> dict[VehicleId, dict[str, tuple[Loop, ...]]]:
    """Return the loops x, y and z around the scenario's leader while another vehicle leads, for every planned slot."""
    leader, positions_m = scenario.leader, [x_rc_m for _, _, row in _planned(scenario) for x_rc_m in row]
    return {leader.vehicle_id: _loops(scenario, leader.model, positions_m)} if leader and positions_m else {}


def _planned(scenario: Scenario) -> list[tuple[VehicleId, VehicleModel, list[float]]]:
    """Return every planned follower, with the x_rc of its scheduled slots."""
    models = {vehicle.vehicle_id: vehicle.model for vehicle in scenario.vehicles}
    return [(each, models[each], (-slots_m[:, 0]).tolist()) for each, slots_m in planned_slots(scenario).items()]


def _loops(scenario: Scenario, model: VehicleModel, positions_m: Sequence[float]) -> dict[str, tuple[Loop, ...]]:
    """Return the loops x, y and z around a follower, with small-signal gains, for each of its planned slots."""
    gains = [gain_range(scenario).gains(nominal, SMALL_SIGNAL) for nominal in nominal_gains(scenario)]
    plants = [_plants(scenario, model, x_rc_m) for x_rc_m in sorted(set(positions_m))]
    aircraft = aircraft_responses(model, scenario.path.begin_mps)
    return {
        axis: tuple(dict.fromkeys(Loop(pid, of_slot[i], aircraft[i], model.dead_time_s) for of_slot in plants))
        for i, (axis, pid) in enumerate(zip("xyz", gains, strict=True))
    }


def _min(margins: Collection[LawMargins]) -> LawMargins:
    def lowest(each: Collection[Mapping[str, float]]) -> dict[str, float]:
        return {axis: min((margin[axis] for margin in each), default=math.inf) for axis in "xyz"}

    return LawMargins(lowest([each.small_signal for each in margins]), lowest([each.worst for each in margins]))


def stated_as_margins(stated: Stated) -> LawMargins:
    """Return what a law states of one vehicle's loops; it has one figure for all of its gains."""
    return LawMargins(stated.delay_s, stated.delay_s)


def _min_of_all(margins: Collection[LawMargins]) -> LawMargins:
    """Return the least margin of each loop that any vehicle has."""
    loops = dict.fromkeys(loop for each in margins for loop in each.small_signal)
    lowest = {loop: min(each.small_signal.get(loop, math.inf) for each in margins) for loop in loops}
    return LawMargins(lowest, lowest)


def _plants(scenario: Scenario, model: VehicleModel, x_rc_m: float) -> tuple[Plant, Plant, Plant]:
    mixer = Mixer(**scenario.law.mixer.model_dump())
    speed_mps, towed = scenario.path.begin_mps, scenario.formation.frame == "follower_heading"
    right = right_plant(mixer, model, speed_mps, max(x_rc_m, TRAIL_S * speed_mps) if towed else 0.0)
    forward = forward_plant(mixer, model)
    return forward, forward if model.hovers else right, height_plant(mixer, model)


def law_margins(scenario: Scenario) -> LawMargins:
    """Return the margins of the law's loops: `consensus`, or x, y and z; empty for a law whose loops aren't known.

    Of a law from outside they are those that it states, by its own names of loops.
    """
    if not law_kind(scenario).has_margins:
        return _min_of_all([stated_as_margins(each) for each in stated_margins(scenario).values()])
    if law_kind(scenario).mutual:
        margin = {"consensus": min(consensus_margins(scenario))}
        return LawMargins(margin, margin)
    return _min(follower_margins(scenario).values())


def scenario_delay_margin(scenario: Scenario) -> float:
    """Return the least delay margin of all loops, s, at the small-signal gains; infinite if no loop is known."""
    if not law_kind(scenario).has_margins:
        return min(law_margins(scenario).small_signal.values(), default=math.inf)
    loops = {loop for axes in law_loops(scenario).values() for of_axis in axes.values() for loop in of_axis}
    return min((loop.delay_margin_s() for loop in loops), default=math.inf)


def law_loops(scenario: Scenario, *, succession: bool = False) -> Mapping[VehicleId, Mapping[str, tuple[Loop, ...]]]:
    """Return, for each vehicle that the law commands, the loops that it is part of, by the name of their margin.

    A mutual law closes its loops around all vehicles at once, including the leader. Other laws close them around
    followers; with `succession` also around the leader, for when another vehicle leads. Vehicles of a law whose loops
    aren't known have none.
    """
    if not law_kind(scenario).has_margins:
        following = planned_slots(scenario)
        everyone = law_kind(scenario).mutual or (succession and bool(following))
        return {each.vehicle_id: {} for each in scenario.vehicles if everyone or each.vehicle_id in following}
    if not law_kind(scenario).mutual:
        loops_of = {
            identity: _loops(scenario, model, positions_m) for identity, model, positions_m in _planned(scenario)
        }
        return loops_of | (leader_loops(scenario) if succession else {})
    loops = tuple(dict.fromkeys(loop for tau in TAUS for loop in _axis_loops(scenario, tau)))
    return {vehicle.vehicle_id: {"consensus": loops} for vehicle in scenario.vehicles}


def law_usages(scenario: Scenario, *, succession: bool = False) -> dict[VehicleId, dict[str, Usage]]:
    """Return what computes the used share of their margin of the loops around each vehicle, by the loop's name.

    Vehicles are those of `law_loops`; a vehicle of which no margin is known has none. Equal loops share one.
    """
    predicted, shared = scenario.law.delay_compensation, dict[object, Usage]()
    found = {
        identity: {axis: shared.setdefault(loops, Usage(loops, predicted=predicted)) for axis, loops in of_axes.items()}
        for identity, of_axes in law_loops(scenario, succession=succession).items()
    }
    if not law_kind(scenario).has_margins:
        for identity, stated in usages(stated_margins(scenario), predicted=predicted).items():
            found[identity] = dict[str, Usage](stated)
    return found


def consensus_margins(scenario: Scenario) -> tuple[float, float]:
    """Return the delay margins, s, of protocol (3) closed through the ground station: along the heading, and across.

    The autopilot's time constant is the undelayed damping, 1/tau_v along and 1/tau_psi across; the part of k3 beyond
    it is delayed. Where the vehicles' time constants differ, this is the least margin over them: a lower bound on
    an undirected graph, since every root belongs to a weighted mean of their dampings. For vehicles with an airframe,
    the loops are closed around its response.
    """
    along, across = (
        min((loop.delay_margin_s() for loop in _axis_loops(scenario, tau)), default=math.inf) for tau in TAUS
    )
    return along, across


def _axis_loops(scenario: Scenario, tau: str) -> list[Loop]:
    """Return the consensus law's loops on the axis that has the autopilot's time constant `tau`."""
    keys, weights, speed_mps = scenario.law.consensus, scenario.adjacency, scenario.path.begin_mps
    kinds = dict.fromkeys(
        (
            1.0 / float(getattr(model, tau)),
            aircraft_responses(model, speed_mps)[TAUS.index(tau)],
            model.dead_time_s,
        )
        for model in dict.fromkeys(vehicle.model for vehicle in scenario.vehicles)
    )
    return [
        replace(loop, aircraft=aircraft, dead_time_s=dead_s)
        for c, aircraft, dead_s in sorted(kinds, key=itemgetter(0))
        for loop in ground_consensus_loops(weights, keys.k1, keys.k2, c, keys.k3 - c)
    ]


def aircraft_responses(model: VehicleModel, speed_mps: float) -> Axes:
    """Return the responses of speed, heading and height at an airspeed, m/s; None for vehicles that fly by (7)."""
    if model.airframe is None:
        return None, None, None
    airframe = model.airframe.parameters()
    return _responses(airframe, speed_mps, (model.tau_v_s, model.tau_psi_s), (model.tau_ha_s, model.tau_hb_s))


@cache
def _responses(
    airframe: AirframeParameters,
    speed_mps: float,
    taus_s: tuple[float, float],
    heights_s: tuple[float, float],
) -> tuple[AircraftResponse, AircraftResponse, AircraftResponse]:
    true, model = (
        airframe_responses(FREQUENCIES, airframe, speed_mps),
        tau_responses(*taus_s, heights_s),
    )
    speed, heading, height = true.speed / model.speed, true.heading / model.heading, true.height / model.height
    return AircraftResponse(speed), AircraftResponse(heading), AircraftResponse(height)
