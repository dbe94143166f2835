"""Delay margins that a law from outside states itself, asked of an instance of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from airlink.endpoint import VehicleId
from formation_scenario.extensions import LAW, LAW_KINDS, Registered
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import planned_slots
from gcs_formation.control.outside import guarded, made
from gcs_formation.control.plain_values import FollowerModel, vehicle_name
from gcs_formation.errors import NotFiniteError, RunAbortedError
from gcs_formation.stability.mismatch import StatedUsage

Margins = Mapping[str, float]


class Stated(NamedTuple):
    """What a law states of the loops around a vehicle."""

    delay_s: Margins
    """Without prediction, by the loop's name."""
    mismatch_s: Callable[[float], Margins]
    """With prediction, about a predicted delay, s; empty if it isn't known."""


def stated_margins(scenario: Scenario) -> dict[VehicleId, Stated]:
    """Return what the scenario's law states of the loops around each planned follower; empty if it states nothing.

    Raises:
        RunAbortedError: the law raised an error, or returned something else than numbers by name.
    """
    entry = scenario.registered.get(scenario.law.type, *LAW_KINDS) if scenario.registered else None
    if entry is None:
        return {}
    try:
        return _of_law(entry, scenario)
    except NotFiniteError as error:
        raise RunAbortedError(f"the {entry} can't state its margins: {error.found}") from error


def _of_law(entry: Registered, scenario: Scenario) -> dict[VehicleId, Stated]:
    followers, law = _followers(scenario), made(entry, scenario.law.parameters)

    def ask(whose: object, method: str, *more: float) -> Margins:
        return _asked(entry, lambda: getattr(law, method)(whose, *more))

    if entry.kind == LAW:
        each = {identity: _stated(one, ask) for identity, one in followers.items()}
    else:
        each = dict.fromkeys(followers, _stated(tuple(followers.values()), ask))
    return {identity: one for identity, one in each.items() if one.delay_s or one.mismatch_s(0.0)}


def usages(stated: Mapping[VehicleId, Stated], *, predicted: bool) -> dict[VehicleId, dict[str, StatedUsage]]:
    """Return what computes the used share of each stated margin in flight, with prediction or without."""

    def of(loop: str, one: Stated) -> StatedUsage:
        def margin_s(delay_s: float) -> float:
            return (one.mismatch_s(delay_s) if predicted else one.delay_s).get(loop, math.nan)

        return StatedUsage(margin_s, predicted=predicted)

    return {
        identity: {loop: of(loop, one) for loop in (one.mismatch_s(0.0) if predicted else one.delay_s)}
        for identity, one in stated.items()
    }


def _stated(whose: FollowerModel | Sequence[FollowerModel], ask: Callable[..., Margins]) -> Stated:
    def mismatch_s(delay_s: float) -> Margins:
        return ask(whose, "mismatch_margins_s", delay_s)

    return Stated(ask(whose, "delay_margins_s"), mismatch_s)


def _asked(entry: Registered, call: Callable[[], Mapping[str, float] | None]) -> Margins:
    """Return a law's answer; empty for None.

    Raises:
        NotFiniteError: it raised an error, or a margin isn't a number.
    """
    found = guarded(entry, lambda: {str(loop): float(margin_s) for loop, margin_s in (call() or {}).items()})
    unknown = [loop for loop, margin_s in found.items() if math.isnan(margin_s)]
    if unknown:
        raise NotFiniteError(str(entry), None, f"margin of loop {unknown[0]}: nan ({entry.where})")
    return found


def _followers(scenario: Scenario) -> dict[VehicleId, FollowerModel]:
    models, found = {each.vehicle_id: each.model for each in scenario.vehicles}, dict[VehicleId, FollowerModel]()
    for identity, slots_m in planned_slots(scenario).items():
        model = models[identity]
        taus_s = model.tau_v_s, model.tau_psi_s, model.tau_ha_s, model.tau_hb_s
        positions = tuple((forward_m, right_m, up_m) for forward_m, right_m, up_m in slots_m.tolist())
        found[identity] = FollowerModel(
            vehicle_name(identity), *taus_s, model.hovers, scenario.path.begin_mps, positions
        )
    return found
