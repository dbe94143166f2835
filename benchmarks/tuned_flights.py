"""Short flights in which tuned numbers decide: what `benchmarks.tuned` flies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

START: Final = {"in_air": True, "run_in_s": 12}
TURN_M: Final = [
    [0, 0, 100],
    [500, 0, 100],
    [1000, -100, 100],
    [1350, -500, 100],
    [1400, -1100, 100],
    [1400, -2500, 100],
]
STRAIGHT: Final = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
AHEAD_AND_BEHIND: Final = {"shape": "custom", "slots_m": {2: [5, -20, 0], 3: [-40, 40, 0]}}
TURN: Final = {"start": START, "vehicles": {"count": 3}, "path": {"speed_mps": 22, "waypoints_m": TURN_M}}
BESIDE: Final = TURN | {"duration_s": 52, "formation": AHEAD_AND_BEHIND}
FOUR: Final = {"start": START, "vehicles": {"count": 4}, "formation": {"shape": "diamond", "spacing_m": 30}}
COPTERS: Final = {
    "vehicles": [
        {"id": each, "model": "px4_copter", "role": "leader" if each == 1 else "follower"} for each in (1, 2, 3, 4)
    ],
    "start": {"in_air": True, "tolerance_m": 1},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [400, 0, 60]]},
    "safety": {"separation_m": 3},
}
HILLS: Final = [
    {"shape": "cosine", "north_m": 1000, "east_m": 20, "height_m": 80, "radius_m": 700},
    {"north_m": 2000, "east_m": -60, "height_m": 60, "radius_m": 300},
]

FLIGHTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "pilot flies straight on": TURN
    | {
        "duration_s": 45,
        "formation": {"shape": "custom", "slots_m": {2: [-10, -80, 0], 3: [-30, 30, 0]}},
        "faults": [{"at_s": 14, "kind": "pilot", "vehicles": [2], "mode": "CRUISE"}],
    },
    "no link": BESIDE | {"links": {"changes": [{"at_s": 36, "vehicles": [2], "outage": True}]}},
    "ignores commands": BESIDE | {"faults": [{"at_s": 36, "vehicles": [2], "kind": "ignore"}]},
    "multirotor sent home": COPTERS
    | {
        "duration_s": 20,
        "formation": {"shape": "custom", "slots_m": {each: [12 - 12 * each, 0, 0] for each in (2, 3, 4)}},
        "faults": [{"at_s": 8, "vehicles": [1], "kind": "pilot", "mode": "RTL"}],
    },
    "multirotors, shape": COPTERS
    | {
        "duration_s": 40,
        "formation": {"shape": "diamond", "spacing_m": 8, "changes": [{"at_s": 5, "shape": "line", "spacing_m": 8}]},
        "links": {"default": {"delay_ms": 100, "jitter_ms": 20, "loss": 0.05}},
    },
    "blown to the fence": FOUR
    | {
        "duration_s": 60,
        "path": STRAIGHT,
        "disturbances": [{"at_s": 5, "until_s": 25, "vehicles": "all", "velocity_mps": [0, 14, 0]}],
        "safety": {"fence": {"corners_m": [[-900, -600], [6000, -600], [6000, 140], [-900, 140]]}},
    },
    "over hills": FOUR
    | {
        "duration_s": 110,
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 70], [500, 0, 50], [1000, 0, 20], [3400, 0, 20]]},
        "terrain": {"clearance_m": 60, "base_m": 0, "hills": HILLS},
        "disturbances": [{"at_s": 25, "until_s": 60, "vehicles": "all", "velocity_mps": [0, 0, 2.5]}],
        "safety": {"clearance_m": 55},
    },
    "turbulence and noise": FOUR
    | {
        "duration_s": 60,
        "vehicles": {"count": 4, "navigation": {"source": "noisy"}},
        "path": TURN["path"],
        "links": {"default": {"delay_ms": 150, "jitter_ms": 20, "loss": 0.05}},
        "disturbances": [{"at_s": 0, "kind": "dryden", "wind_6m_mps": 7}],
    },
    "losses": FOUR
    | {
        "duration_s": 60,
        "path": TURN["path"],
        "links": {"default": {"delay_ms": 300, "jitter_ms": 30, "loss": 0.2, "mean_burst": 5}},
    },
    "leader silent": FOUR
    | {"duration_s": 40, "path": STRAIGHT, "links": {"changes": [{"at_s": 10, "vehicles": [1], "outage": True}]}},
    "position drifts": FOUR
    | {
        "duration_s": 45,
        "path": STRAIGHT,
        "faults": [
            {
                "at_s": 12,
                "vehicles": [3],
                "kind": "telemetry",
                "quantity": "position",
                "effect": "drift",
                "amount": [0, 3, 0],
            }
        ],
    },
    "position frozen": FOUR
    | {
        "duration_s": 45,
        "path": STRAIGHT,
        "faults": [{"at_s": 12, "vehicles": [3], "kind": "telemetry", "quantity": "position", "effect": "freeze"}],
    },
    "ignores the end": {
        "duration_s": 10,
        "start": {"in_air": True, "run_in_s": 8},
        "vehicles": {"count": 4},
        "finish": {"loiter_s": 12},
        "path": STRAIGHT,
        "formation": {"shape": "line", "spacing_m": 15},
        "faults": [{"at_s": 9.5, "until_s": 19.5, "vehicles": [2], "kind": "ignore"}],
    },
}
"""Flights by what happens in them; each a minute or less."""
