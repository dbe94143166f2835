"""Delay margins of the PID laws' three loops, closed over the link around equation (7), or around an airframe."""

from __future__ import annotations

from dataclasses import replace

from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, GainRange
from gcs_formation.library.gains import LawGains
from gcs_formation.stability import aircraft_responses
from gcs_formation.stability.mismatch import MismatchMargin, predicted_mismatch_margin
from gcs_formation.stability.pid_margins import (
    SMALL_SIGNAL,
    Loop,
    forward_plant,
    height_plant,
    less_dead_time,
    right_plant,
    worst_loop_margin,
)


def delay_margins(
    gains: LawGains,
    model: VehicleModel,
    *,
    speed_mps: float = 22.0,
    ahead_m: float = 0.0,
    gain_range: GainRange = FIXED_GAINS,
    worst: bool = False,
) -> dict[str, float]:
    """Return the loop delay, s, at which each of the loops x, y and z is lost without prediction.

    Compare it with `loop_delay_s`: both ways of the link, sampling and hold. 0 or less: unstable without delay.

    Args:
        gains: of `design_gains`, or one's own.
        model: the vehicle.
        speed_mps: of the leader.
        ahead_m: how far the leader is ahead of the slot, where slots turn with the follower (`follower_heading`); 0
            where they turn with the leader.
        gain_range: of the fuzzy law's gains about these, as `GainRange()`; the default is that of the PID law.
        worst: with the least favourable gains of that range, not those at zero error.
    """
    found = _loops(gains, model, speed_mps, ahead_m)
    if worst:
        return {axis: _worst_s(each, gain_range) for axis, each in found.items()}
    return {axis: each.delay_margin_s() for axis, each in _at_zero_error(found, gain_range).items()}


def mismatch_margins(
    gains: LawGains,
    model: VehicleModel,
    predicted_s: float,
    *,
    speed_mps: float = 22.0,
    ahead_m: float = 0.0,
    gain_range: GainRange = FIXED_GAINS,
) -> dict[str, MismatchMargin]:
    """Return how far the delay may be from the predicted one, s, before each of the loops x, y and z is lost.

    Args:
        gains: of `design_gains`, or one's own.
        model: the vehicle; the margins are around equation (7).
        predicted_s: the loop delay that the prediction compensates.
        speed_mps: of the leader.
        ahead_m: as of `delay_margins`.
        gain_range: as of `delay_margins`.

    Raises:
        ValueError: a delay below 0.
    """
    if not predicted_s >= 0.0:
        raise ValueError(f"predicted_s: found {predicted_s!r}; allowed: a number >= 0")
    found = _at_zero_error(_loops(gains, model, speed_mps, ahead_m), gain_range)
    return {axis: predicted_mismatch_margin(each, predicted_s) for axis, each in found.items()}


def _loops(gains: LawGains, model: VehicleModel, speed_mps: float, ahead_m: float) -> dict[str, Loop]:
    """Return the loops with nominal gains."""
    if not speed_mps > 0.0:
        raise ValueError(f"speed_mps: found {speed_mps!r}; allowed: a number > 0")
    forward = forward_plant(gains.mixer, model)
    right = forward if model.hovers else right_plant(gains.mixer, model, speed_mps, ahead_m)
    plants = forward, right, height_plant(gains.mixer, model)
    pids = gains.speed, gains.speed if model.hovers else gains.heading, gains.height
    each = zip("xyz", pids, plants, aircraft_responses(model, speed_mps), strict=True)
    return {axis: Loop(pid, plant, aircraft, model.dead_time_s) for axis, pid, plant, aircraft in each}


def _worst_s(loop: Loop, gain_range: GainRange) -> float:
    return less_dead_time(worst_loop_margin(loop.pid, loop.plant, gain_range, loop.aircraft), loop.dead_time_s)


def _at_zero_error(loops: dict[str, Loop], gain_range: GainRange) -> dict[str, Loop]:
    return {axis: replace(each, pid=gain_range.gains(each.pid, SMALL_SIGNAL)) for axis, each in loops.items()}
