"""Fits a vehicle's model to recordings by prediction errors (Ljung, "System Identification", 2nd ed., 7.2).

Equation (7), by which the law predicts and feeds forward, is fitted to whole flights (`output_error`) and judged by
predictions: from points all along the recording the model flies on from the measured state, by the recorded setpoints,
for `HORIZON_S`. The airframe, which emulators fly, is fitted elsewhere (`airframe`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from flight_model.arrays import Array, Indices, wrap
from flight_model.slot import CHANNELS
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, advance
from formation_scenario.vehicles import VehicleModel
from gcs_formation.identify.identifiability import (
    QUANTITIES,
    TAUS,
    TAUS_OF,
    Estimate,
    hardly_moved,
    too_little,
    unexplained,
    unknown,
)
from gcs_formation.identify.output_error import Search, simulated
from gcs_formation.identify.recording import CYCLE_S, STEP_S, Recording

HORIZON_S = 6.0
"""Length of the predictions that equation (7) is judged by: what the law feeds forward takes as long to arrive."""
STRIDE = 5
"""Points between the starts of two predictions."""
WAIT_SIGMA_S = CYCLE_S / 2.0
"""Standard deviation of the time at which setpoints act. They act anywhere within the vehicle's cycle, but always at
the same phase of it in one flight. Half a cycle, the distance from its middle to its end, covers a vehicle that always
acts at the end."""
UNKNOWN = 0.5
"""Prior standard deviation of a time constant's logarithm, and of the dead time in seconds."""
DEAD = "dead_time_s"
"""The autopilot's dead time. The search is for it in seconds, for all other parameters in logarithms."""
DEAD_MAX_S = 2.0
CLEAR = 1.96
"""A dead time of fewer standard deviations isn't distinguished from none; the others are then fitted without it."""
REST = ("prompt_share", "rest_s")
"""Also fitted for vehicles assumed to leave part of a speed change to an integrator."""
MIN_SHARE = 0.2
QUICK_MPS = 0.2
"""A larger change of a multirotor's velocity setpoint within `STEP_S` isn't gentle."""
QUICK_S = 5.0
"""Lags aren't fitted to what was measured within this time after such a change."""
MIN_KEPT = 0.2
"""Share of a recording that must be left after that."""


@dataclass(frozen=True)
class Fit:
    """A fitted model and how well it predicts each quantity, by its name."""

    model: VehicleModel
    estimates: dict[str, Estimate]
    residual_rms: dict[str, float]
    """Errors of airspeed (m/s), heading (rad) and height (m) over the horizon."""
    explained: dict[str, float]
    """Share of the change over the horizon that the predictions explain."""
    unidentified: dict[str, str] = field(default_factory=dict)
    """Why a channel isn't identified, by its name; the model has its time constants from where the search began."""


def fit(recordings: Sequence[Recording], begin: VehicleModel) -> Fit:
    """Return the model of equation (7) that fits recordings of one kind of vehicle best, and how well it predicts.

    `begin` has the limits, which are kept, and the time constants that the search begins with. Each channel is found
    from the recordings that have its setpoints.

    Raises:
        RecordError: no channel was moved enough in the recordings.
    """
    still = hardly_moved(recordings)
    fitted = [name for channel in CHANNELS if channel not in still for name in TAUS_OF[channel]]
    every = TAUS if begin.prompt_share == 1.0 else (*TAUS, *REST)
    names = [name for name in every if name in fitted or (name in REST and "speed" not in still)]
    begin = begin.model_copy(update={DEAD: 0.0})
    logs, covariance = _searched(recordings, begin, names, gentle=begin.hovers)
    gentle = begin.hovers and not unknown(_estimates(names, logs, covariance), covariance)
    if begin.hovers and not gentle:  # nothing was moved but quickly
        logs, covariance = _searched(recordings, begin, names, gentle=False)
    estimates = _estimates(names, logs, covariance)
    dead, more = _dead_time(recordings, begin, (names, logs), gentle=gentle)
    if more is not None:
        estimates, covariance = more
    unidentified = still | unknown(estimates, covariance)
    rms, explained = _judged(recordings, _found(begin, estimates, unidentified), unidentified)
    unidentified |= unexplained(explained)
    if len(unidentified) == len(CHANNELS):
        raise too_little(unidentified)
    model, estimates = _found(begin, estimates, unidentified), _identified(estimates, unidentified)
    estimates |= {DEAD: dead._replace(value=max(dead.value, 0.0))}
    kept = [name for name, channel in zip(QUANTITIES, CHANNELS, strict=True) if channel not in unidentified]
    rms, explained = ({name: each[name] for name in kept} for each in (rms, explained))
    return Fit(model, estimates, rms, explained, unidentified)


def _identified(estimates: Mapping[str, Estimate], unidentified: Collection[str]) -> dict[str, Estimate]:
    """Return the parameters without those of unidentified channels."""
    return {
        name: each
        for name, each in estimates.items()
        if not any(name in TAUS_OF[channel] for channel in unidentified)
        and (name not in REST or "speed" not in unidentified)
    }


def _found(begin: VehicleModel, estimates: Mapping[str, Estimate], unidentified: Collection[str]) -> VehicleModel:
    """Return the model with the identified channels' parameters, and otherwise as the search began."""
    kept = _identified(estimates, unidentified)
    return begin.model_copy(update={name: round(each.value, 3) for name, each in kept.items()})


def _dead_time(
    recordings: Sequence[Recording], begin: VehicleModel, known: tuple[Sequence[str], Array], *, gentle: bool
) -> tuple[Estimate, tuple[dict[str, Estimate], Array] | None]:
    """Return the dead time, and where it is distinguished from none all estimates with it, and their covariance.

    `known`: the names and the values of the parameters found without a dead time, from which it is searched for first.
    """
    names, tried = [*known[0], DEAD], (np.append(known[1], 0.0), None)
    for near in tried:
        logs, covariance = _searched(recordings, begin, names, gentle=gentle, near=near)
        estimates = _estimates(names, logs, covariance)
        dead = estimates[DEAD]
        if not dead.value > CLEAR * dead.sigma:
            return dead, None
    return dead, (estimates, covariance)


def _searched(
    recordings: Sequence[Recording],
    begin: VehicleModel,
    names: Sequence[str],
    *,
    gentle: bool,
    near: Array | None = None,
) -> tuple[Array, Array]:
    """Return the named parameters (P,) as they are searched for, found from `begin` on, and their covariance (P, P).

    `near`: where the search is to go on, if something near the solution is known.
    """
    start = np.array([getattr(begin, name) if name == DEAD else math.log(getattr(begin, name)) for name in names])
    spare_s = DEAD_MAX_S if DEAD in names else 0.0
    flown = partial(_as_flown, recordings, begin, names, spare_s)
    known = [_known(_gentle(each) if gentle else each, spare_s) for each in recordings]
    search = Search(known, flown, start, np.full(start.size, UNKNOWN))
    if near is None:
        search.find()
    else:
        search.refine(near)
    return search.logs, search.covariance(partial(flown, later_s=WAIT_SIGMA_S))


def _estimates(names: Sequence[str], logs: Array, covariance: Array) -> dict[str, Estimate]:
    """Return the parameters, by name: height's time constants in order, and the fast fraction within its limits."""
    values = _values(names, logs)
    if TAUS[-1] in values:
        values |= zip(TAUS_OF["height"], sorted(values[name] for name in TAUS_OF["height"]), strict=True)
    if REST[0] in values:
        values[REST[0]] = min(max(values[REST[0]], MIN_SHARE), 1.0)
    sigmas = np.sqrt(np.diag(covariance)).tolist()
    each = zip(values.items(), sigmas, strict=True)
    return {name: Estimate(value, sigma if name == DEAD else value * sigma) for (name, value), sigma in each}


def _values(names: Sequence[str], logs: Array) -> dict[str, float]:
    """Return the parameters as numbers with their units, by name."""
    each = zip(names, logs.tolist(), strict=True)
    return {name: min(value, DEAD_MAX_S) if name == DEAD else math.exp(value) for name, value in each}


def _judged(
    recordings: Sequence[Recording], model: VehicleModel, unidentified: Collection[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the errors of a model's predictions, RMS, and the share of the changes that these explain, by quantity.

    Of each identified channel, in the recordings that have it.
    """
    values = np.array([getattr(model, name) for name in (*TAUS, *REST)])
    fitted = values if model.prompt_share < 1.0 else values[: len(TAUS)]
    rms, explained, squares = dict[str, float](), dict[str, float](), list[Array]()
    for each in recordings:
        windows = _Windows.of(_later(_with_rest(each, model, fitted), model))
        squares.append(np.array((windows.errors(values[: len(TAUS)], model), windows.changes())) ** 2)
    for row, (name, channel) in enumerate(zip(QUANTITIES, CHANNELS, strict=True)):
        if channel not in unidentified:
            having = [both[:, row] for each, both in zip(recordings, squares, strict=True) if channel in each.channels]
            error, change = np.concatenate(having, axis=2).mean(axis=(1, 2)).tolist()
            rms[name], explained[name] = math.sqrt(error), 1.0 - error / max(change, 1e-12)
    return rms, explained


def _gentle(recording: Recording) -> Recording:
    """Return a multirotor's recording without the airspeeds and courses that follow a quick change of its setpoints.

    Quick changes are limited in jerk, which isn't a time constant: an ArduCopter takes half as long again for a step of
    2 m/s as for one of 0.3 m/s. A formation changes its setpoints gently, and the law leads them by the time constant
    of gentle changes. If too little is left, the whole recording counts.
    """
    speed, course, _ = recording.commanded
    quick: Indices = np.flatnonzero(np.abs(np.diff(speed * np.exp(1j * course))) > QUICK_MPS) + 1
    late, samples = recording.delay_s / STEP_S, list(recording.measured())
    for channel in (0, 1):
        at, value = samples[channel]
        before = np.searchsorted(quick, at - late, side="right") - 1
        since = at - late - np.append(quick, -np.inf)[before] if quick.size else np.full(at.shape, np.inf)
        kept = since * STEP_S >= QUICK_S
        if np.count_nonzero(kept) < MIN_KEPT * at.size:
            return recording
        samples[channel] = at[kept], value[kept]
    return replace(recording, samples=tuple(samples))


def _known(recording: Recording, spare_s: float = 0.0) -> Recording:
    """Return a recording from the point on where its setpoints act: late by the link's delay, and a dead time."""
    late = math.ceil((recording.delay_s + spare_s) / STEP_S)
    measured = tuple((at[at >= late] - late, value[at >= late]) for at, value in recording.measured())
    seen, commanded = recording.seen[:, late:], recording.commanded[:, late:]
    return replace(recording, seen=seen, commanded=commanded, samples=measured)


def _as_flown(
    recordings: Sequence[Recording],
    limits: VehicleModel,
    names: Sequence[str],
    spare_s: float,
    logs: Array,
    later_s: float = 0.0,
) -> tuple[list[Array], AutopilotModels]:
    """Return the setpoints that act on each vehicle with these parameters, by name, and the model that flies it."""
    every = TAUS if limits.prompt_share == 1.0 else (*TAUS, *REST)
    found, acting = _values(names, logs), list[Array]()
    values = np.array([found.get(name, getattr(limits, name)) for name in every])
    later_s += found.get(DEAD, limits.dead_time_s)
    for each in recordings:
        late = math.ceil((each.delay_s + spare_s) / STEP_S)
        acting.append(_acting_setpoints(_with_rest(each, limits, values), later_s)[:, late:])
    return acting, _columns(values[:4], limits, 1)


def _acting_setpoints(recording: Recording, later_s: float = 0.0) -> Array:
    """Return setpoints and the lateral acceleration of turns, (4, K), when they act."""
    commanded = recording.commanded
    turning = np.broadcast_to(recording.lateral_mps2, commanded[:1].shape)
    return acting(np.concatenate((commanded, turning)), recording.delay_s + later_s)


def _later(recording: Recording, model: VehicleModel) -> Recording:
    """Return a recording whose delay has the model's dead time in it."""
    return replace(recording, delay_s=recording.delay_s + model.dead_time_s)


def _with_rest(recording: Recording, limits: VehicleModel, values: Array) -> Recording:
    return recording if values.size == len(TAUS) else _aimed(recording, limits, *values[len(TAUS) :])


def _aimed(recording: Recording, model: VehicleModel, prompt_share: float, rest_s: float) -> Recording:
    """Return a recording with the setpoints that the vehicle aims at while its integrator catches up.

    With a commanded velocity w it aims at prompt_share w + (1 - prompt_share) m, and m follows w with the time constant
    rest_s. For a fixed wing this is its airspeed only.
    """
    share = min(max(float(prompt_share), MIN_SHARE), 1.0)
    speed, heading, height = recording.commanded
    course = heading if model.hovers else np.zeros_like(heading)
    commanded = speed * np.exp(1j * course)
    filled, kept, m = np.empty_like(commanded), math.exp(-STEP_S / float(rest_s)), commanded[0]
    for point, each in enumerate(commanded.tolist()):
        filled[point] = m
        m = kept * m + (1.0 - kept) * each
    aimed = share * commanded + (1.0 - share) * filled
    turned = wrap(np.angle(aimed) - course)
    return replace(recording, commanded=np.stack((np.abs(aimed), heading + turned, height)))


@dataclass(frozen=True)
class _Windows:
    """Stretches of a recording, W of them, that predictions cover."""

    state: FlightStates
    """(W,) measured states at their starts."""
    commanded: Array
    """(P, 3, W) setpoints of each step."""
    seen: Array
    """(3, P, W) measurements at the end of each step."""

    @classmethod
    def of(cls, recording: Recording) -> _Windows:
        """Cut a recording into windows; setpoints are delayed by the link's delay."""
        points, late = round(HORIZON_S / STEP_S), math.ceil(recording.delay_s / STEP_S)
        begins: Indices = np.arange(late, recording.seen.shape[1] - points, STRIDE, dtype=np.intp)
        steps: Indices = np.arange(points, dtype=np.intp)[:, None]
        airspeed, heading, height, climb = recording.seen[:, begins]
        none = np.zeros_like(airspeed)
        state = FlightStates(none, none, height, climb, np.maximum(airspeed, 1.0), heading, none, none)
        commanded = acting(recording.commanded, recording.delay_s)[:, begins + steps].transpose(1, 0, 2)
        return cls(state, commanded, recording.seen[:3, begins + steps + 1])

    def errors(self, time_constants: Array, limits: VehicleModel) -> Array:
        """Return (3, P, W): predicted minus measured, by equation (7) with these time constants."""
        model = _columns(time_constants, limits, self.commanded.shape[2])
        state, step_s, ends = self.state, np.full(self.commanded.shape[2], STEP_S), list[Array]()
        for commanded in self.commanded:
            state = advance(state, commanded, step_s, model)
            ends.append(np.array((state.airspeed_mps, state.heading_rad, state.height_m)))
        error = np.stack(ends, axis=1) - self.seen
        error[1] = wrap(error[1])
        return error

    def changes(self) -> Array:
        """Return (3, P, W): change of the measurements since the start of each window."""
        begin = np.array((self.state.airspeed_mps, self.state.heading_rad, self.state.height_m))
        return self.seen - begin[:, None]


def acting(commanded: Array, late_s: float) -> Array:
    """Return setpoints (3, K) as they act, `late_s` after they were sent."""
    whole, part = divmod(late_s / STEP_S, 1.0)
    points: Indices = np.arange(commanded.shape[1], dtype=np.intp) - int(whole)
    newer, older = (np.clip(each, 0, commanded.shape[1] - 1) for each in (points, points - 1))
    return (1.0 - part) * commanded[:, newer] + part * commanded[:, older]


def _columns(time_constants: Array, limits: VehicleModel, count: int) -> AutopilotModels:
    constants = np.array([*time_constants, *limits.autopilot().values()[len(TAUS) :]])
    return AutopilotModels.of(np.repeat(constants[:, None], count, axis=1))


def flown_by_time_constants(recording: Recording, model: VehicleModel) -> Array:
    """Return airspeed, heading and height (3, K) of a vehicle of equation (7) under the recorded setpoints."""
    if model.prompt_share < 1.0:
        recording = _aimed(recording, model, model.prompt_share, model.rest_s)
    columns = _columns(np.array([getattr(model, name) for name in TAUS]), model, 1)
    return simulated([_acting_setpoints(recording, model.dead_time_s)], columns, recording.seen[:, :1].T)[0]
