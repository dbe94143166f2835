"""The reference flights: their command lines and durations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

Keys = dict[str, Any]

SHORT: Keys = {
    "schema": 1,
    "name": "short",
    "seed": 1,
    "duration_s": 14,
    "vehicles": {"count": 3},
    "start": {"in_air": True, "run_in_s": 6},
    "finish": {"loiter_s": 2},
    "formation": {"shape": "arrow", "spacing_m": 30},
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]},
}
"""A leader and two followers in the air, on a straight path."""


@dataclass(frozen=True)
class Flight:
    """A flight by a scenario: a file of the earlier tree, or keys."""

    name: str
    scenario: str | Keys
    until_s: float | None = None
    overrides: tuple[str, ...] = ()
    clock: str = "virtual"


@dataclass(frozen=True)
class Stress:
    """A flight of `stress`, which draws its scenario from its seed."""

    seed: int
    hard: bool

    @property
    def name(self) -> str:
        """Its name among the flights."""
        return f"stress-{'hard' if self.hard else 'usual'}-{self.seed}"


def _short(name: str, **keys: Any) -> Flight:
    return Flight(name, SHORT | {"name": name} | keys)


def _fault(kind: str, vehicle: int = 2, **keys: Any) -> Flight:
    return _short(f"fault-{kind}", faults=[{"at_s": 2, "vehicles": [vehicle], "kind": kind, **keys}])


FLIGHTS: tuple[Flight, ...] = (
    Flight("quickstart", "configs/quickstart.yaml", 5),
    Flight("paper", "configs/paper.yaml", 25),
    Flight("hills", "configs/hills.yaml", 15),
    Flight("noise", "configs/noise.yaml", 15),
    Flight("arduplane", "configs/arduplane.yaml", 15, ("start.in_air=true", "start.run_in_s=10")),
    Flight("consensus", "configs/paper.yaml", 10, ("law={type: consensus}", "finish={loiter_s: 2}")),
    _short("change", duration_s=20, formation=SHORT["formation"] | {"changes": [{"at_s": 2, "shape": "line"}]}),
    _short(
        "links",
        start={"in_air": True, "run_in_s": 14},
        links={
            "default": {"delay_ms": 150, "jitter_ms": 20, "loss": 0.05},
            "changes": [{"at_s": 5, "vehicles": [2], "delay_ms": 300, "reorder": True}],
        },
        wind={"velocity_mps": [2, 1, 0]},
        disturbances=[{"at_s": 4, "vehicles": "all", "velocity_mps": [0.6, 0.6, 0.0]}],
    ),
    _fault("crash"),
    _fault("freeze", until_s=9),
    _fault("restart"),
    _fault("ignore", until_s=8),
    _fault("pilot", vehicle=1, until_s=8),
    Flight("udp", SHORT | {"name": "udp"}, 3, clock="real"),
)


def reference_flights(seeds: int) -> Iterable[Flight | Stress]:
    """Return every flight, with this many of `stress` for each severity."""
    drawn = (Stress(seed, hard) for hard in (False, True) for seed in range(1, seeds + 1))
    return (*FLIGHTS, *drawn)
