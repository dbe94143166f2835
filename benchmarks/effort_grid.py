"""Steps of setpoints against errors, for gains, filters and the slew limit of the law, point by point.

Each point flies 80 s three times under the virtual clock, beginning (8, 6, 4) m from the slots: configs/paper.yaml over
perfect links, where the steps of the setpoints are taken; the same with 300 ms each way and 0.6 m/s north and east on
every vehicle at 60 s, D1; and configs/noise.yaml with 300 ms each way. Figures are the worst follower's, from 30 s on
(D1's from 60 s on); steps are the 95th percentile and, in brackets, the largest. About 25 s of processor time for each
point.
"""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Generator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from benchmarks import PAPER, both_directions, flown, parser
from flight_model.arrays import Array
from flight_model.gain_design import UNMODELLED
from flight_model.slot import Vector3
from formation_scenario import Scenario
from gcs_formation.control import follower, follower_loops, laws
from gcs_formation.control.follower_loops import LawInput
from gcs_formation.control.setpoint import Target
from gcs_formation.estimation import vehicle_filter
from gcs_formation.record.figures_of_merit import setpoint_steps
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import TIMESERIES
from gcs_formation.studies.markdown import markdown

NOISE = PAPER.with_name("noise.yaml")
LAW_PARAMETERS = laws.law_parameters
STEADY_S, DISTURBED_S, END_S = 30.0, 60.0, 80.0
D1: list[Mapping[str, Any]] = [{"at_s": DISTURBED_S, "vehicles": "all", "velocity_mps": [0.6, 0.6, 0.0]}]
CLEAN_MAX = (0.05, 0.25, 0.3, 1.5)
"""Limits of the steps over perfect links, 95th percentile and largest: of speed, m/s, then of heading, degrees."""
NOISY_MAX = (0.15, 0.75, 0.5, 2.5)
D1_MAX_M, NOISE_MAX_M, SETTLED_MAX_S = (0.02, 0.03), (0.25, 0.25), 25.0


class Differences(follower.FollowerController):
    """A follower's law that differentiates mixed errors instead of computing rates from states."""

    _before: Vector3 | None = None

    def _slopes(self, pair: LawInput, axis_rad: float, target: Target, forward: Vector3, dt_s: float) -> Vector3:  # noqa: ARG002
        before, self._before = self._before or self.mixed, self.mixed
        speed, heading, height = ((now - then) / dt_s for now, then in zip(self.mixed, before, strict=True))
        return speed, heading, height


class Point(NamedTuple):
    """One setting of the law: keys for exact and for noisy telemetry, and constants that aren't keys."""

    name: str
    clean: Mapping[str, Any] = {}
    noise: Mapping[str, Any] = {}
    slew: float = 1.0
    """Factor of the slew limit of corrections."""
    walk: float = 1.0
    """Factor of the state filter's random walk in speed and heading, which sets its bandwidth."""
    differences: bool = False

    @contextlib.contextmanager
    def in_force(self) -> Generator[None]:
        """Fly with this point's settings within the context."""
        law = Differences if self.differences else follower.FollowerController
        walk = tuple(self.walk * each for each in UNMODELLED)
        with (
            mock.patch.multiple(laws, law_parameters=self._law_parameters, FollowerController=law),
            mock.patch.object(vehicle_filter, "COMMANDED_WALK", walk),
        ):
            yield

    def _law_parameters(self, scenario: Scenario) -> follower_loops.LawParameters:
        faster, turned = follower_loops.SLEW
        return replace(LAW_PARAMETERS(scenario), slew=(self.slew * faster, self.slew * turned))


def gains(kp: float, ki: float, kd: float, times: float = 1.0) -> dict[str, float]:
    """Return a channel's gains with the bandwidth multiplied by `times`."""
    return {"kp": times * kp, "ki": times**2 * ki, "kd": times * kd}


def scaled(times: float) -> Point:
    """Return the point whose bandwidths of speed and heading are `times` the default."""
    clean = {"speed": gains(3.0, 0.8, 6.5, times), "heading": gains(1.2, 0.5, 1.8, times)}
    noise = {"speed": gains(1.0, 0.1, 1.0, times), "heading": gains(0.5, 0.1, 0.05, times)}
    return Point(f"gains × {times:g}", clean, noise)


POINTS = (
    Point("default"),
    Point("rates by differences of errors", differences=True),
    Point("no slew limit", slew=1e6),
    Point("slew limit × 0.25", slew=0.25),
    Point("state filter's walk × 0.33", walk=1 / 3),
    Point("state filter's walk × 3", walk=3.0),
    Point("derivative filter × 3", {"derivative_filter_s": 0.3}, {"derivative_filter_s": 3.0}),
    Point("wind observer × 0.5", {"disturbance_observer_radps": 1.0}, {"disturbance_observer_radps": 0.15}),
    scaled(0.5),
    scaled(1.5),
    Point("speed 1, 0.2, 1", {"speed": gains(1.0, 0.2, 1.0)}, {"speed": gains(1.0, 0.2, 1.0)}),
)


class Flight(NamedTuple):
    """Figures of a flight's worst follower."""

    steps: tuple[float, ...]
    """Speed steps, m/s, 95th percentile and largest; heading steps, degrees, likewise: from `STEADY_S` on."""
    rms_m: tuple[float, ...]
    """Errors along x and y from `STEADY_S` on."""
    d1_m: tuple[float, ...]
    """Largest errors along x and y from `DISTURBED_S` on."""
    settled_s: float


Setting = tuple[Path, float, list[Mapping[str, Any]]]
"""One scenario that every point flies: its file, the delay of its links, and its disturbances."""
SETTINGS: tuple[Setting, ...] = ((PAPER, 0.0, []), (PAPER, 300.0, D1), (NOISE, 300.0, []))


def fly(point: Point, setting: Setting) -> Flight:
    """Fly one scenario with a point's keys."""
    scenario, delay_ms, disturbances = setting
    keys = point.noise if scenario == NOISE else point.clean
    given: dict[str, Any] = {f"law__{key}": value for key, value in keys.items()}
    given |= {"duration_s": END_S, "links": both_directions(delay_ms), "disturbances": disturbances, "expect": []}
    with point.in_force(), flown(scenario, **given) as summary:
        series = read_parquet(summary.run_dir / TIMESERIES)
    vehicles = [series["vehicle"] == number for number in (2, 3, 4)]
    each = [_figures({name: values[rows] for name, values in series.items()}) for rows in vehicles]
    steps, rms_m, d1_m = (tuple(np.max(rows, axis=0).tolist()) for rows in zip(*each, strict=True))
    settled = [follower["settled_at_s"] or math.inf for follower in summary.to_dict()["followers"].values()]
    return Flight(steps, rms_m, d1_m, max(settled))


def _figures(columns: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Return steps, rms and largest errors of one follower."""
    begun = columns["mission_time_s"] >= STEADY_S
    speed, heading = (setpoint_steps(columns, channel)[begun] for channel in ("speed", "heading"))
    errors = np.array([columns[f"error_{axis}_m"] for axis in "xy"])
    late = np.abs(errors[:, columns["mission_time_s"] >= DISTURBED_S])
    sizes = np.array([[np.nanpercentile(size, 95), np.nanmax(size)] for size in (speed, np.degrees(heading))])
    return sizes.ravel(), np.sqrt(np.nanmean(errors[:, begun] ** 2, axis=1)), np.nanmax(late, axis=1)


def row(point: Point, flights: list[Flight]) -> list[str]:
    """Return a row of the table."""
    quiet, disturbed, noisy = flights
    settled_s = max(each.settled_s for each in flights)
    figures = (*quiet.steps, *noisy.steps, *disturbed.d1_m, *noisy.rms_m, settled_s)
    maxima = (*CLEAN_MAX, *NOISY_MAX, *D1_MAX_M, *NOISE_MAX_M, SETTLED_MAX_S)
    held = all(figure <= limit for figure, limit in zip(figures, maxima, strict=True))
    cells = [_steps(quiet.steps), _steps(noisy.steps), _pair(disturbed.d1_m), _pair(noisy.rms_m), f"{settled_s:.1f}"]
    return [point.name, *cells, "yes" if held else "no"]


def _steps(steps: tuple[float, ...]) -> str:
    return "{:.3f} ({:.3f}) / {:.2f} ({:.2f})".format(*steps)


def _pair(errors_m: tuple[float, ...]) -> str:
    return " / ".join(f"{error_m:.3f}" for error_m in errors_m)


def main() -> None:
    """Fly the grid and print its table."""
    parsing = parser(__doc__, only="points whose name has TEXT in it")
    given = parsing.parse_args()
    if not follower.__file__.endswith(".py"):
        parsing.error("compiled modules don't heed what points change of them; run it where they are Python")
    chosen = [point for point in POINTS if given.only in point.name]
    jobs = [(point, setting) for point in chosen for setting in SETTINGS]
    with ProcessPoolExecutor(given.processes) as pool:
        flown = pool.map(fly, *zip(*jobs, strict=True))
        rows = list[list[str]]()
        for point in chosen:
            rows.append(row(point, [next(flown) for _ in SETTINGS]))
            print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    head = ["point", *(f"steps {how}: speed m/s / heading °" for how in ("on perfect links", "with noise"))]
    print(markdown([*head, "D1 at 300 ms: x / y, m", "noise at 300 ms: rms x / y, m", "settled, s", "held"], rows))


if __name__ == "__main__":
    main()
