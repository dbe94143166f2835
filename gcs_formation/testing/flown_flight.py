"""A flown flight, with the checks that a test makes on it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, Vehicle
from gcs_formation.phases import COMMANDED
from gcs_formation.record.coverage import Coverage, coverage
from gcs_formation.record.expectations import FAILINGS, covered, none_flew
from gcs_formation.record.flight import RecordedFlight, split
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import TIMESERIES
from gcs_formation.record.summary import Summary
from gcs_formation.record.timeseries import PHASES

AXES = "xyz"
MAX_NAMED = 8
Vehicles = int | str | Sequence[int | str]
"""One vehicle's id (or "network:id"), several, or "all"."""


def in_words(vehicle: VehicleId, axis: str, size_m: float, at_s: float) -> str:
    """Return a follower's error along an axis in words; NaN: it isn't known."""
    if math.isnan(size_m):
        return f"vehicle {vehicle}: error_{axis} unknown at {at_s:.1f} s"
    return f"vehicle {vehicle}: |error_{axis}| = {size_m:.3f} m at {at_s:.1f} s"


@dataclass(frozen=True)
class FlownFlight:
    """A flown flight. A check raises AssertionError if it fails, and otherwise returns the flight for the next one."""

    scenario: Scenario
    summary: Summary
    directory: Path
    """The run's directory: run.yaml, flight.tlog, timeseries.parquet, events.jsonl, summary.json."""
    command: str
    """The command that repeats the flight."""

    @property
    def figures(self) -> Mapping[str, Any]:
        """Content of summary.json."""
        return self.summary.figures

    def link(self, vehicle: int | str) -> Mapping[str, Any]:
        """Return a vehicle's entry of `links` in summary.json: delay and loss, injected and measured."""
        (identity,) = (str(each.vehicle_id) for each in self._chosen(vehicle, self.scenario.vehicles))
        return self.figures["links"][identity]

    def series(self, vehicle: int | str) -> Mapping[str, Array]:
        """Return a vehicle's columns of timeseries.parquet, a row for each tick at which the formation is commanded."""
        (chosen,) = self._chosen(vehicle, self.scenario.vehicles)
        return self._series_of(chosen.vehicle_id)

    def stays_within(
        self,
        limit_m: float,
        *,
        axes: str = AXES,
        followers: Vehicles = "all",
        from_s: float = 0.0,
        to_s: float | None = None,
    ) -> Self:
        """Check that followers are within `limit_m` of their slots along each axis, at every tick of a window.

        A vehicle has no slot at ticks at which it leads; a leader that follows later has one from then on. The check
        fails if of none of them enough of the window is judged, as for `expect`: because it led, or ticks are missing.

        Args:
            limit_m: the largest |error| allowed, m.
            axes: of x (forward), y (right) and z (up), in the scenario's slot frame.
            followers: one, several or "all".
            from_s: mission time at which the window begins, s.
            to_s: where it ends; None: at the end of the flight.
        """
        __tracebackhide__ = True
        if not axes or not set(axes) <= set(AXES):
            raise ValueError(f"found axes {axes!r}; allowed: one or more of x, y, z")
        end_s = self.figures["duration_s"] if to_s is None else to_s
        window = f"from {from_s:g} s to {end_s:g} s"
        chosen = self._chosen(followers, self._followers)
        reached_s = self.figures["duration_s"]
        within = from_s <= end_s <= reached_s + 1.0 / self.scenario.law.rate_hz
        self._require(within, f"the flight went to {reached_s:.1f} s, not through {window}")
        self._require_as_planned()
        worst = [each for vehicle in chosen for each in self._worst(vehicle.vehicle_id, axes, from_s, end_s)]
        self._require(bool(worst), f"none of these followed {window}", [each.vehicle_id for each in chosen])
        beyond = (each for each in worst if not each[0] <= limit_m)
        broken = sorted(beyond, key=lambda each: math.inf if math.isnan(each[0]) else each[0], reverse=True)
        claim = f"more than {limit_m:g} m from the slot along {', '.join(axes)} {window}"
        self._require(not broken, claim, [text for _, text in broken])
        judged = {each.vehicle_id: self._followed(each.vehicle_id, from_s, end_s) for each in chosen}
        parts = [f"vehicle {vehicle}: {each.share:.0%} of it judged" for vehicle, each in judged.items()]
        self._require(any(each.enough for each in judged.values()), f"not judged {window}", parts)
        return self

    def settles(self, *, before_s: float, followers: Vehicles = "all") -> Self:
        """Check that followers come within 0.5 m of their slots, and stay there for 10 s, before a mission time."""
        __tracebackhide__ = True
        chosen = [str(vehicle.vehicle_id) for vehicle in self._chosen(followers, self._followers)]
        times = {who: self.figures["followers"][who]["settled_at_s"] for who in chosen}
        late = [
            f"vehicle {who}: " + ("never" if at_s is None else f"at {at_s:.1f} s")
            for who, at_s in times.items()
            if at_s is None or not at_s < before_s
        ]
        self._require_as_planned()
        self._require(bool(times), f"none followed that could settle before {before_s:g} s")
        self._require(not late, f"not settled before {before_s:g} s", late)
        return self

    def keeps_apart(self, min_m: float) -> Self:
        """Check that no two vehicles come closer than `min_m`, in a flight that was recorded to its end.

        As with `expect`, the check fails if vehicles are on the ground or ticks are missing.
        """
        __tracebackhide__ = True
        end_s = self.figures["duration_s"]
        down_s, recorded = self._flight.down_from_s(0.0, end_s), covered(self._flight, 0.0, end_s, self.scenario)
        missing = ("" if recorded.enough else str(recorded)) if down_s is None else none_flew(down_s)
        self._require(not missing, f"not {min_m:g} m apart all through the flight: {missing}")
        self._require_as_planned()
        nearest_m = self.figures["safety"]["min_separation_m"]
        seen = nearest_m is not None
        self._require(seen and nearest_m >= min_m, f"vehicles {nearest_m} m apart; expected: {min_m:g} m or more")
        return self

    def meets_its_expectations(self) -> Self:
        """Check what exit status 0 means: what was judged of `expect` holds, and some was; no safety limit broken."""
        __tracebackhide__ = True
        verdicts = self.summary.verdicts
        broken = [str(verdict) for verdict in verdicts if verdict.held is False]
        self._require(not broken and not self.summary.breaches, "not as expected", [*broken, *self.summary.breaches])
        self._require(bool(verdicts), "no expectation was judged: the scenario has no expect")
        judged = any(verdict.held is not None for verdict in verdicts)
        self._require(judged, "no expectation was judged", verdicts)
        return self

    @property
    def _followers(self) -> Sequence[Vehicle]:
        """Vehicles that followed at some time of the flight."""
        return [each for each in self.scenario.vehicles if str(each.vehicle_id) in self.figures["followers"]]

    @cached_property
    def _flight(self) -> RecordedFlight:
        columns, count = read_parquet(self.directory / TIMESERIES), len(self.scenario.vehicles)
        return split({name: each.reshape(-1, count) for name, each in columns.items()}, self.scenario)

    def _series_of(self, vehicle: VehicleId) -> Mapping[str, Array]:
        own = self._flight.vehicles[vehicle]
        commanded = np.isin(own["phase"], [PHASES.index(phase.value) for phase in COMMANDED])
        return {name: values[commanded] for name, values in own.items()}

    def _followed(self, vehicle: VehicleId, from_s: float, to_s: float) -> Coverage:
        """Return in which part of a window a vehicle followed."""
        series = self._series_of(vehicle)
        time_s = series["mission_time_s"]
        window = (time_s >= from_s - 1e-9) & (time_s <= to_s + 1e-9)
        recorded = coverage(time_s[window], from_s, to_s, 1.0 / self.scenario.law.rate_hz)
        followed = 1.0 - float((series["leads"][window] > 0).sum()) / max(1.0, float(window.sum()))
        return replace(recorded, share=recorded.share * followed)

    def _worst(self, vehicle: VehicleId, axes: str, from_s: float, to_s: float) -> Iterator[tuple[float, str]]:
        """Yield the largest |error| along each axis with its words; NaN, which is worst, if one isn't known."""
        series = self._series_of(vehicle)
        time_s = series["mission_time_s"]
        window = (time_s >= from_s - 1e-9) & (time_s <= to_s + 1e-9)
        leads = series["leads"] > 0
        led, window = (window & leads).any(), window & ~leads
        for axis in axes:
            if not window.any():
                if led:
                    return
                yield math.nan, in_words(vehicle, axis, math.nan, from_s)
                continue
            size_m = np.abs(series[f"error_{axis}_m"][window])
            index = int(np.argmax(size_m))
            worst_m = float(size_m[index])
            yield worst_m, in_words(vehicle, axis, worst_m, float(time_s[window][index]))

    def _chosen(self, names: Vehicles, among: Sequence[Vehicle]) -> list[Vehicle]:
        if names == "all":
            return list(among)
        wanted = [names] if isinstance(names, int | str) else list(names)
        if not wanted:
            raise ValueError('found no vehicle; allowed: one or more, or "all"')
        known = {name: each for each in among for name in (each.id, str(each.vehicle_id), f"{each.network}:{each.id}")}
        missing = [name for name in wanted if name not in known]
        if missing:
            allowed = ", ".join(str(each.vehicle_id) for each in among)
            raise ValueError(f"found vehicle {missing[0]}; allowed: {allowed}")
        return [known[name] for name in wanted]

    def _require_as_planned(self) -> None:
        """Require that what the scenario planned was done, and that no vehicle was lost or left unsafe."""
        __tracebackhide__ = True
        failings = [text for key in FAILINGS for text in self.figures[key]]
        self._require(not failings, "not flown as planned", failings)

    def _require(self, holds: bool, claim: str, broken: Sequence[object] = ()) -> None:
        __tracebackhide__ = True
        if holds:
            return
        lines = [claim, *(f"  {each}" for each in broken[:MAX_NAMED])]
        if len(broken) > MAX_NAMED:
            lines.append(f"  … and {len(broken) - MAX_NAMED} more")
        source = "ground truth" if self.figures["truth"] else "telemetry"
        lines += [
            f"seed {self.scenario.seed}, errors by {source}, recorded in {self.directory}",
            f"again: {self.command}",
        ]
        raise AssertionError("\n".join(lines))
