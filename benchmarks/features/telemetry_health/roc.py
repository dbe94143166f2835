"""Alarm threshold of the checks of positions against velocities: false alarms by it, and how soon faults are found.

`python -m benchmarks.features.telemetry_health.roc --hours 3` prints, for bounds scaled by a factor, false
alarms an hour of one aircraft's flight and the time in which drifts and jumps are found (median and slowest of 20). No
flight: an aircraft's motion with turns and gusts, and a GNSS receiver's noise, white and correlated, that isn't
declared.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Final

import numpy as np

from gcs_formation.features.telemetry_health.consistency import Consistency
from gcs_formation.studies.markdown import markdown

STEP_S: Final = 0.1
SPEED_MPS: Final = 22.0
FASTEST_MPS: Final = 60.0
SCALES: Final = (0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
TRIES: Final = 20
SETTLED_S: Final = 20.0
FAULTS: Final[dict[str, Callable[[float], float]]] = {
    "drift 1 m/s": lambda since_s: since_s,
    "drift 2 m/s": lambda since_s: 2.0 * since_s,
    "drift 3 m/s": lambda since_s: 3.0 * since_s,
    "jump 5 m": lambda _: 5.0,
    "jump 10 m": lambda _: 10.0,
}


class Aircraft:
    """One that turns by turns and meets gusts, with a receiver's noise."""

    def __init__(self, seed: int) -> None:
        """Draw its noise."""
        self.rng = np.random.default_rng(seed)
        self.heading_rad, self.turn_rps = 0.0, 0.0
        self.position, self.gust, self.correlated_m = np.zeros(2), np.zeros(2), np.zeros(2)
        self.sigma_m, self.sigma_mps = self.rng.uniform(0.1, 1.5), self.rng.uniform(0.05, 0.3)
        self.before, self.number = self.velocity(), 0

    def velocity(self) -> np.ndarray:
        """Return its true velocity."""
        air = np.array((math.cos(self.heading_rad), math.sin(self.heading_rad)))
        return np.asarray(SPEED_MPS * air + self.gust)

    def step(self) -> tuple[int, list[float], list[float], list[float]]:
        """Return the next stamp, position, velocity, and the velocity by airspeed, heading and a wind of no gusts."""
        if self.rng.random() < STEP_S / 8.0:
            self.turn_rps = float(self.rng.uniform(-0.25, 0.25)) if self.turn_rps == 0.0 else 0.0
        self.heading_rad += self.turn_rps * STEP_S
        self.gust += -self.gust * STEP_S / 5.0 + 2.0 * math.sqrt(2.0 * STEP_S / 5.0) * self.rng.standard_normal(2)
        self.correlated_m += -self.correlated_m * STEP_S / 30.0 + math.sqrt(
            2.0 * STEP_S / 30.0
        ) * self.rng.standard_normal(2)
        now = self.velocity()
        self.position += STEP_S / 2.0 * (now + self.before)
        self.before, self.number = now, self.number + 1
        measured = self.position + self.correlated_m + self.sigma_m * self.rng.standard_normal(2)
        velocity = now + self.sigma_mps * self.rng.standard_normal(2)
        return 1 + round(self.number * STEP_S * 1e9), measured.tolist(), velocity.tolist(), (now - self.gust).tolist()


def false_alarms(scale: float, hours: float) -> float:
    """Return the false alarms an hour."""
    count, aircraft = 0, range(max(1, round(4 * hours)))
    for seed in aircraft:
        flown, checked = Aircraft(seed), Consistency(2, FASTEST_MPS, scale)
        was = None
        for _ in range(round(900.0 / STEP_S)):
            checked.take(*flown.step(), (0.01, 0.01))
            count += checked.wrong is not None and was is None
            was = checked.wrong
    return count / (len(aircraft) / 4.0)


def found_s(scale: float, fault: Callable[[float], float]) -> list[float]:
    """Return how long each of `TRIES` faults went on until it was found, s; infinite after 30 s."""
    times_s = list[float]()
    for seed in range(1000, 1000 + TRIES):
        flown, checked, time_s = Aircraft(seed), Consistency(2, FASTEST_MPS, scale), 0.0
        found = math.inf
        for number in range(round((SETTLED_S + 30.0) / STEP_S)):
            stamp, position, velocity, witness = flown.step()
            time_s = number * STEP_S - SETTLED_S
            if time_s > 0.0:
                position = [position[0], position[1] + fault(time_s)]
            elif checked.wrong is not None:
                checked.forget()
            checked.take(stamp, position, velocity, witness, (0.01, 0.01))
            if time_s > 0.0 and checked.wrong is not None:
                found = time_s
                break
        times_s.append(found)
    return times_s


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--hours", type=float, default=3.0)
    given, rows = options.parse_args(), list[list[str]]()
    for scale in SCALES:
        cells = [f"{scale:g}", f"{false_alarms(scale, given.hours):.1f}"]
        for fault in FAULTS.values():
            times_s = found_s(scale, fault)
            cells.append(f"{np.median(times_s):.1f} / {max(times_s):.1f}")
        rows.append(cells)
        print("...", *cells, flush=True)
    print(markdown(["bounds x", "false alarms an hour", *(f"{each}, s" for each in FAULTS)], rows))


if __name__ == "__main__":
    main()
