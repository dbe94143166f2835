"""How much delay does a formation tolerate without prediction? A study in Python: `python examples/delay_study.py`."""

import gcs_formation

STUDY = {
    "name": "delay",
    "base": {
        "vehicles": {"count": 2},
        "start": {"in_air": True},
        "duration_s": 20,
        "path": {"waypoints_m": [[0, 0, 100], [2000, 0, 100]]},
    },
    "parameters": {"links.default.delay_ms": [0, 200], "law.delay_compensation": [True, False]},
    "metrics": ["error_x_m.p95", "error_x_m.max", "margin_used"],
    "record": "none",
}

if __name__ == "__main__":  # workers import this script
    table = gcs_formation.study(STUDY, "runs/delay-study", overwrite=True)
    print("delay, ms  prediction  95 % of the time within, m  share of the delay margin")
    for row in table.sort_by("links.default.delay_ms").to_pylist():
        print(
            f"{row['links.default.delay_ms']:9.0f}  {'yes' if row['law.delay_compensation'] else 'no':10}"
            f"  {row['error_x_m.p95']:26.3f}  {row['margin_used']:25.0%}"
        )
