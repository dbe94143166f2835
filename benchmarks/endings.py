"""Least separation, from take-off to the last acknowledgement, of flights at whose end a vehicle stops responding."""

from __future__ import annotations

from typing import Any

from benchmarks import events_of, flown
from gcs_formation.studies.markdown import markdown

END_S, BEGINS_S, FOR_S = 10.0, 9.5, 10.0
GEOMETRIES: dict[str, dict[str, Any]] = {
    "abreast: 2 at (−5, 20), 3 at (−30, −30) m": {"shape": "custom", "slots_m": {2: [-5, 20, 0], 3: [-30, -30, 0]}},
    "line, 15 m": {"shape": "line", "spacing_m": 15},
    "square, 20 m": {"shape": "square", "spacing_m": 20},
    "line, 30 m": {"shape": "line", "spacing_m": 30},
}
TROUBLES = ("none", "uplink", "both", "ignore")
"""Trouble of vehicle 2: none; its uplink fails; both ways fail; it acknowledges commands but ignores them."""


def scenario(formation: dict[str, Any], trouble: str) -> dict[str, Any]:
    """Return a flight that ends half a second after the trouble begins."""
    keys: dict[str, Any] = {
        "duration_s": END_S,
        "vehicles": {"count": 3 if formation["shape"] == "custom" else 4},
        "start": {"in_air": True, "run_in_s": 8},
        "finish": {"loiter_s": 12},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100]]},
        "formation": formation,
    }
    times_s = BEGINS_S, BEGINS_S + FOR_S
    if trouble == "ignore":
        keys["faults"] = [{"at_s": times_s[0], "until_s": times_s[1], "vehicles": [2], "kind": "ignore"}]
    elif trouble != "none":
        states = [{"outage": out} if trouble == "both" else {trouble: {"outage": out}} for out in (True, False)]
        changes = [{"at_s": at_s, "vehicles": [2]} | state for at_s, state in zip(times_s, states, strict=True)]
        keys["links"] = {"changes": changes}
    return keys


def ended(keys: dict[str, Any]) -> str:
    """Return the minimum separation, m, and the time, s, at which vehicles were commanded to loiter."""
    with flown(keys) as summary:
        begins_s = {event["text"]: event["t_s"] for event in events_of(summary, "phase")}
    return f"{summary.to_dict()['safety']['min_separation_m']:.1f}, {begins_s['loitering'] - begins_s['ending']:.0f} s"


def main() -> None:
    """Print the table."""
    rows = ([name, *(ended(scenario(keys, trouble)) for trouble in TROUBLES)] for name, keys in GEOMETRIES.items())
    print(markdown(("formation", *TROUBLES), rows))


if __name__ == "__main__":
    main()
