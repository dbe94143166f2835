"""Encounters flown by model (7) with and without the rule; links delay, jitter and lose, and states are old."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import Array, Mask
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints, advance
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.approach import Traffic, sample_times
from gcs_formation.features.separation.broad_phase import KeptDistance
from gcs_formation.features.separation.conflict_resolution import resolve
from gcs_formation.features.separation.traffic import TrafficPicture
from tests.gcs_formation import tables

DT_S = 0.1
KEPT_M = 10.0
STEP_S = 0.05
TIMES_S = sample_times(DT_S + 0.2, 12.0)
MODEL = {
    "tau_v_s": 4.0,
    "tau_psi_s": 1.5,
    "tau_ha_s": 1.0,
    "tau_hb_s": 3.0,
    "speed_min_mps": 16.0,
    "speed_max_mps": 28.0,
    "accel_max_mps2": 1.5,
    "turn_rate_max_rps": 0.25,
    "climb_max_mps": 3.0,
}


def model(count: int) -> AutopilotModels:
    return AutopilotModels(*(np.full(count, value) for value in MODEL.values()))


@dataclass
class Vehicles:
    """Vehicles, a row [north, east, height, speed, heading, turn rate] each; the law asks all to continue for ever."""

    rows: list[list[float]]
    commanded: list[bool] | None = None
    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    seed: int = 0
    floor_m: float = 15.0
    fence_m: tuple[float, float] = (-math.inf, math.inf)
    """Heights of the fence."""

    @property
    def state(self) -> FlightStates:
        north, east, height, speed, heading, _ = np.array(self.rows, dtype=np.float64).T
        still = np.zeros(north.size)
        return FlightStates(north, east, height, still, speed, heading, still, still)

    @property
    def turn_rps(self) -> Array:
        return np.array(self.rows)[:, 5]

    @property
    def flown_by_us(self) -> Mask:
        return np.array(self.commanded or [True] * len(self.rows))


@dataclass
class Flown:
    min_m: float = math.inf
    sides: list[Array] = field(default_factory=list[Array])
    setpoints: list[Array] = field(default_factory=list[Array])

    @property
    def gave_way(self) -> Mask:
        return np.any(self.sides, axis=0)

    @property
    def changes(self) -> Array:
        """Return how often each vehicle began or ended to evade, or changed sides."""
        return np.abs(np.diff(np.sign(self.sides), axis=0, prepend=0.0)).sum(axis=0)


def picture(vehicles: Vehicles, state: FlightStates, setpoints: Setpoints, age_s: float = 0.0) -> TrafficPicture:
    count, ours = len(vehicles.rows), vehicles.flown_by_us
    return TrafficPicture(
        traffic=Traffic(
            state,
            np.zeros(count),
            np.where(ours, 0.0, vehicles.turn_rps),
            model(count),
            np.zeros((2, count)),
            hovers=False,
        ),
        setpoints=Setpoints(*np.where(ours, setpoints.table, np.nan)),
        commanded=ours,
        vehicles=np.arange(count),
        kept=KeptDistance(KEPT_M),
        slots_m=100.0 * np.arange(count) * np.ones((3, 1)),
        timing_s=np.full(count, 0.1 * (2 * vehicles.delay_s + age_s)),
        floor=lambda state: np.full(state.north_m.size, vehicles.floor_m),
        times_s=TIMES_S,
        heights_m=vehicles.fence_m,
    )


def wanted(vehicles: Vehicles, time_s: float) -> Setpoints:
    """Return the law's setpoints: the initial speed and height; the heading leads a turn by the autopilot's lag."""
    state, turn = vehicles.state, vehicles.turn_rps
    heading = state.heading_rad + turn * (time_s + MODEL["tau_psi_s"])
    return Setpoints(state.airspeed_mps, heading, state.height_m)


def encounter(vehicles: Vehicles, seconds: float = 40.0, *, rule: bool = True) -> Flown:
    """Fly; states arrive with the link's delay, setpoints act after it, or never."""
    count, random = len(vehicles.rows), np.random.default_rng(vehicles.seed)
    each = model(count)
    true, side, flown = vehicles.state, np.zeros(count), Flown()
    history = SetpointHistory(1 / DT_S)
    held = wanted(vehicles, 0.0).table
    reckoned = round(vehicles.delay_s * NANOSECONDS)
    on_the_way: list[tuple[float, int, Array]] = []
    past = [true]
    for step in range(round(seconds / STEP_S)):
        now_s = step * STEP_S
        if step % round(DT_S / STEP_S) == 0:
            seen = past[max(0, len(past) - 1 - round(vehicles.delay_s / STEP_S))]
            now = Instant(round(now_s * NANOSECONDS))
            setpoints = wanted(vehicles, now_s + vehicles.delay_s)
            acts, since = np.full(count, now + reckoned), np.full(count, max(0, now - reckoned))
            history.begin_tick(vec[i64](acts.tolist()))
            state = tables.predict(history, seen, since, acts, each)
            if rule:
                side = _give_way(picture(vehicles, state, setpoints), side, setpoints)
            history.record(tables.setpoints(setpoints))
            flown.sides.append(side)
            flown.setpoints.append(setpoints.table)
            late_s = np.maximum(0.0, vehicles.delay_s + vehicles.jitter_s * random.standard_normal(count))
            arrives = np.flatnonzero(random.random(count) >= vehicles.loss).tolist()
            on_the_way += [(now_s + float(late_s[i]), i, setpoints.table[:, i]) for i in arrives]
        on_the_way = _delivered(on_the_way, now_s, held)
        flies = np.where(vehicles.flown_by_us, held, wanted(vehicles, now_s).table)
        true = advance(true, flies, np.full(count, STEP_S), each)
        past.append(true)
        flown.min_m = min(flown.min_m, _nearest_m(true))
    return flown


def _give_way(picture: TrafficPicture, side: Array, setpoints: Setpoints) -> Array:
    decided = resolve(picture, side)
    for sent, instead in zip(
        (setpoints.speed_mps, setpoints.heading_rad, setpoints.height_m), decided.setpoints.table, strict=True
    ):
        sent[:] = instead
    return decided.side


def _delivered(on_the_way: list[tuple[float, int, Array]], now_s: float, held: Array) -> list[tuple[float, int, Array]]:
    """Put what has arrived into `held`; return the rest."""
    for _, vehicle, setpoint in sorted((a for a in on_the_way if a[0] <= now_s + 1e-9), key=lambda a: a[0]):
        held[:, vehicle] = setpoint
    return [a for a in on_the_way if a[0] > now_s + 1e-9]


def _nearest_m(state: FlightStates) -> float:
    place = np.stack((state.north_m, state.east_m, state.height_m))
    difference = np.linalg.norm(place[:, :, None] - place[:, None], axis=0)
    return float(difference[np.triu_indices(len(difference), 1)].min())
