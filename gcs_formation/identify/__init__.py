"""`gcs-formation identify`: fits a vehicle's model to a recorded flight; writes a vehicle file and a figure."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from flight_model.arrays import Array
from flight_model.slot import CHANNELS
from formation_scenario import Scenario, load_scenario
from formation_scenario.registry import Files
from formation_scenario.source import Dumper, plain_mapping
from formation_scenario.vehicles import EnergyAirframe, VehicleModel
from gcs_formation.errors import RecordError
from gcs_formation.identify.airframe import AIRFRAME_KEYS, fit_airframe, time_constants_of
from gcs_formation.identify.fitting import Fit, fit, flown_by_time_constants
from gcs_formation.identify.identifiability import QUANTITIES, TAUS
from gcs_formation.identify.initial_model import begin_with
from gcs_formation.identify.output_error import autocovariance
from gcs_formation.identify.recording import STEP_S, Recording, recordings
from gcs_formation.identify.run_summary import delays_s, unfit
from gcs_formation.record.run_directory import SCENARIO, TLOG
from gcs_formation.report.style import FOLLOWERS, GREY, INK, axes_grid, new_figure, print_style, save

HEIGHT_CM = 14.0
MIN_ERROR = 1e-9
"""Floor of errors: a model that flies its own recording has none, and nothing is better than that."""
UNITS = ("m/s", "rad", "m")
EQUATION, AIRFRAME = "equation (7)", "airframe"
"""Names of the models."""
FIGURE = ".png"


def draw(recording: Recording, flown: dict[str, Array], file: Path) -> None:
    """Draw a recording and simulated flights by its setpoints, (3, K) by the model's name, as a PNG."""
    at_s: Array = STEP_S * np.arange(recording.seen.shape[1], dtype=np.float64)
    scales = (1.0, 180.0 / np.pi, 1.0)
    with print_style():
        figure = new_figure(HEIGHT_CM)
        axes = [row[0] for row in axes_grid(figure, 3, 1, sharex=True)]
        for row, (axis, label, scale) in enumerate(zip(axes, recording.labels, scales, strict=True)):
            axis.plot(at_s, recording.seen[row] * scale, color=INK, label="measured")
            axis.set_ylabel(label)
            if CHANNELS[row] not in recording.channels:
                axis.set_title("no setpoints in this recording", loc="right", fontsize="medium")
                continue
            axis.step(at_s, recording.commanded[row] * scale, where="post", color=GREY, linewidth=0.6, label="setpoint")
            for (name, values), colour in zip(flown.items(), FOLLOWERS, strict=False):
                axis.plot(at_s, values[row] * scale, color=colour, linestyle="--", label=name)
        axes[-1].set_xlabel("time, s")
        legend = axes[min(CHANNELS.index(name) for name in recording.channels)]
        legend.legend(ncols=2 + len(flown), loc="lower left", bbox_to_anchor=(0.0, 1.0))
        save(figure, file)


def require_writable(file: Path, *, overwrite: bool, given: bool = False) -> None:
    """Refuse a vehicle file that exists, or whose figure does, unless with `overwrite`; and one named like the figure.

    If the file is `given` by the user, its directory is made, to find out now whether it is writable.

    Raises:
        RecordError: what was found and what is allowed.
    """
    if file.is_dir():
        raise RecordError(f"--out: found {file}, a directory; allowed: a vehicle file (*.yaml)")
    if file.suffix == FIGURE:
        raise RecordError(f"--out: found {file}; allowed: another ending than that of the figure beside it, {FIGURE}")
    there = [str(each) for each in (file, file.with_suffix(FIGURE)) if each.exists()]
    if there and not overwrite:
        found = f"--out: found {' and '.join(there)}"
        raise RecordError(f"{found}; allowed: a file that isn't there yet, or --overwrite, which replaces it")
    if given:
        _require_directory(file)


def _require_directory(file: Path) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        why = "" if os.access(file.parent, os.W_OK) else "Permission denied"
    except OSError as error:
        why = error.strerror or str(error)
    if why:
        raise RecordError(f"--out: found {file}: {why}; allowed: a file in a directory that can be written")


def identify(
    source: Path,
    file: Path,
    vehicle: int | None = None,
    accepted: Scenario | None = None,
    plugins: Files = (),
) -> dict[str, Any]:
    """Fit a model to a recording, write the vehicle file and its figure beside it; return what `--json` prints.

    The written model has an airframe if that fits the recording so much better that its parameters are worth it; its
    time constants are then those of slow changes. `flown_rms` has the errors of a flight simulated by the setpoints
    alone, by the model's name: of the longest recording among those with the most of the identified channels, in these.

    Args:
        source: a run directory, or a log of a format in `logs.READERS`.
        file: the vehicle file to write.
        vehicle: system id to use; None: all vehicles, as one kind.
        accepted: the scenario, whose first vehicle's limits are kept; None: the run directory's.
        plugins: files of extensions that the run directory's scenario names.

    Raises:
        RecordError: nothing to read, too little movement, or no such vehicle.
        ScenarioError: the run directory's scenario can't be read.
    """
    directory = source if source.is_dir() else None
    found = _recorded(source, vehicle)
    if directory is not None and accepted is None:
        accepted = load_scenario(directory / SCENARIO, plugins=plugins)
    begin = begin_with(accepted, found)
    fitted = _nearest(found, begin) if accepted is None else fit(found, begin)
    longest = max(found, key=lambda each: (len(_shared(each, fitted)), each.seen.shape[1]))
    model, flown = _chosen(longest, fitted, begin)
    known = [row for row, channel in enumerate(CHANNELS) if channel in _shared(longest, fitted)]
    errors = {name: _rms(longest, values)[known] for name, values in flown.items()}
    quantities = [QUANTITIES[row] for row in known]
    shown = {name: values for name, values in flown.items() if name == EQUATION or model.airframe is not None}
    figure = file.with_suffix(FIGURE)
    try:
        _write(file, source, fitted, model, dict(zip(quantities, errors[_kept(model, flown)].tolist(), strict=True)))
        draw(longest, shown, figure)
    except OSError as error:
        raise RecordError(f"{file}: {error.strerror or error}") from error
    return {
        "file": str(file),
        "figure": str(figure),
        "vehicles": [each.system for each in found],
        "setpoints": [_described(each) for each in found],
        "recorded_s": [each.duration_s for each in found],
        "channels": [list(each.channels) for each in found],
        "unfit": None if directory is None else unfit(directory),
        "lags": {name: each._asdict() for name, each in fitted.estimates.items()},
        "unidentified": fitted.unidentified,
        "residual_rms": fitted.residual_rms,
        "explained": fitted.explained,
        "flown_rms": {name: dict(zip(quantities, rms.tolist(), strict=True)) for name, rms in errors.items()},
        "model": model.model_dump(exclude_none=True),
    }


def _recorded(source: Path, vehicle: int | None) -> list[Recording]:
    """Return the recordings of all vehicles in a run directory or a log, or of one vehicle.

    Raises:
        RecordError: nothing to read, or no such vehicle.
    """
    lacking = [name for name in (SCENARIO, TLOG) if source.is_dir() and not (source / name).is_file()]
    if lacking:
        raise RecordError(f"found no {lacking[0]} in {source}; allowed: the directory of a run")
    found = recordings(source / TLOG, delays_s(source)) if source.is_dir() else recordings(source)
    chosen = [each for each in found if vehicle is None or each.system == vehicle]
    if not chosen:
        raise RecordError(f"--vehicle: found {vehicle}; allowed: {', '.join(str(each.system) for each in found)}")
    return chosen


def _nearest(recordings: Sequence[Recording], begin: VehicleModel) -> Fit:
    """Return the fit that predicts airspeed best, with the shipped integrator or without one."""
    fits = [fit(recordings, begin)]
    if begin.prompt_share < 1.0 and QUANTITIES[0] in fits[0].residual_rms:
        fits.append(fit(recordings, begin.model_copy(update={"prompt_share": 1.0})))
    return min(fits, key=lambda each: each.residual_rms.get(QUANTITIES[0], math.inf))


def _shared(recording: Recording, fitted: Fit) -> list[str]:
    """Return the identified channels that a recording has."""
    return [channel for channel in recording.channels if channel not in fitted.unidentified]


def _chosen(recording: Recording, fitted: Fit, begin: VehicleModel) -> tuple[VehicleModel, dict[str, Array]]:
    """Return the model that is worth its parameters, and the flight (3, K) by each model, by its name."""
    flown = {EQUATION: flown_by_time_constants(recording, fitted.model)}
    if begin.hovers or begin.prompt_share < 1.0 or len(_shared(recording, fitted)) < len(CHANNELS):
        return fitted.model, flown
    airframe, flown[AIRFRAME] = fit_airframe(recording, begin.airframe or EnergyAirframe(), begin.turn_rate_max_rps)
    by_airframe, by_taus = (flown[name] - recording.seen[:3] for name in (AIRFRAME, EQUATION))
    if not is_nearer(by_airframe, by_taus, len(AIRFRAME_KEYS) - len(TAUS) - (fitted.model.dead_time_s > 0.0)):
        return fitted.model, flown
    return time_constants_of(airframe, fitted.model, float(np.median(recording.seen[0]))), flown


def report(found: Mapping[str, Any]) -> str:
    """Return the result as text."""
    recorded = zip(found["vehicles"], found["recorded_s"], found["channels"], strict=True)
    whose = ", ".join(
        f"{system} ({duration_s:.0f} s{_those_of(channels)})" for system, duration_s, channels in recorded
    )
    lines = [f"vehicles {whose}", *_setpoints_text(found["setpoints"])]
    lines.append("equation (7), as the law predicts and feeds forward by it:")
    for name, each in found["lags"].items():
        unit = "" if name == "prompt_share" else "s"
        lines.append(f"  {name:<12} {measured(each['value'], each['sigma'])} {unit}".rstrip())
    lines += [f"  not identified, {why}; kept as declared" for why in found["unidentified"].values()]
    lines.append("errors of its predictions, and what they explain of the change:")
    units = dict(zip(QUANTITIES, UNITS, strict=True))
    for name in found["residual_rms"]:
        unit = units[name]
        lines.append(f"  {name:<13} {found['residual_rms'][name]:.3f} {unit:<4} {found['explained'][name]:.0%}")
    lines.append("errors of a whole flight by the setpoints alone, RMS:")
    for name, rms in found["flown_rms"].items():
        each_error = (f"{error:.3f} {units[quantity]}" for quantity, error in rms.items())
        lines.append(f"  {name:<13} {', '.join(each_error)}")
    if "airframe" in found["model"] and AIRFRAME in found["flown_rms"]:
        time_constants = ", ".join(f"{name} {found['model'][name]:g}" for name in found["lags"])
        lines.append(
            f"it flies as an aircraft under total-energy control; time constants of slow changes, s: {time_constants}"
        )
    lines.append(f"wrote {found['file']} and {found['figure']}")
    return "\n".join(lines)


def _those_of(channels: Sequence[str]) -> str:
    """Return the channels whose setpoints were recorded, in words; nothing if all were."""
    return "" if len(channels) == len(CHANNELS) else f" of {', '.join(channels)}"


def _setpoints_text(setpoints: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return where setpoints are from and what they identify, each location in the log once."""
    lines = list[str]()
    for each in setpoints:
        during = f", in {', '.join(each['modes'])}" if each["modes"] else ""
        lines.append(f"setpoints: {each['from']}{during}")
        lines += [f"  {each['identifies']}"] if each["identifies"] else []
    return list(dict.fromkeys(lines))


def is_nearer(errors: Array, others: Array, more: int) -> bool:
    """Return whether a model fits the recording so much better that its further parameters are worth it.

    By Schwarz's information criterion: n ln(mean square) over the channels, and ln(n) for each parameter. n is the
    number of independent errors, K / (1 + 2 sum of their autocorrelations), the smaller one of the two models'. Source:
    Ljung, "System Identification", 2nd ed., 16.4.

    Args:
        errors: (3, K) of its flight: airspeed, heading and height.
        others: (3, K) of the other model's flight.
        more: by how many parameters it exceeds the other model.
    """
    counts = np.minimum(_independent(errors), _independent(others))
    squares, other_squares = (np.maximum(np.mean(each**2, axis=1), MIN_ERROR**2) for each in (errors, others))
    gained = float(counts @ np.log(other_squares / squares))
    return gained > more * math.log(float(counts.sum()))


def _independent(errors: Array) -> Array:
    """Return the number of independent errors among (3, K) in each channel, at least 1."""
    points = errors.shape[1]
    alike = autocovariance(errors, points * STEP_S)
    together = 1.0 + 2.0 * alike[:, 1:].sum(axis=1) / np.maximum(alike[:, 0], MIN_ERROR**2 / points)
    return np.clip(points / np.maximum(together, 1.0), 1.0, None)


def measured(value: float, sigma: float) -> str:
    """Return a value and its standard deviation, to two significant digits of the latter."""
    digits = max(1 - math.floor(math.log10(sigma)), 0) if sigma > 0.0 else 3
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def _rms(recording: Recording, flown: Array) -> Array:
    return np.sqrt(np.mean((flown - recording.seen[:3]) ** 2, axis=1))


def _kept(model: VehicleModel, flown: Collection[str]) -> str:
    """Return the name of the model that is written; a declared airframe stays if none was fitted and flown."""
    return AIRFRAME if model.airframe is not None and AIRFRAME in flown else EQUATION


def _described(recording: Recording) -> dict[str, Any]:
    """Return where a recording's setpoints are from, and what follows from them."""
    track = recording.track
    return {"from": track.setpoints, "modes": list(recording.modes), "identifies": track.identifies}


def _write(file: Path, source: Path, fitted: Fit, model: VehicleModel, flown: Mapping[str, float]) -> None:
    figures = {f"{name}_sigma": each.sigma for name, each in fitted.estimates.items()}
    figures |= {f"predicted_{name}": value for name, value in fitted.residual_rms.items()}
    figures |= {f"flown_{name}": value for name, value in flown.items()}
    written = {
        "schema": 1,
        "name": file.stem[:80],
        "source": f"gcs-formation identify {source.name}",
        "model": model.model_dump(exclude_none=True),
        "fit": {name: float(f"{value:.3g}") for name, value in figures.items()},
    }
    text = yaml.dump(plain_mapping(written), Dumper=Dumper, sort_keys=False, allow_unicode=True)
    file.write_text(text, encoding="utf-8")
