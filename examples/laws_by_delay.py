"""How laws bear delay: each at four delays with ten seeds, a table and a figure. `python examples/laws_by_delay.py`."""

import statistics
from pathlib import Path

import matplotlib.pyplot as plt
import pyarrow as pa

import gcs_formation

LAWS = {
    "fuzzy PID": {"law.type": "fuzzy_pid"},
    "PID": {"law.type": "pid"},
    "consensus": {"law.type": "consensus"},
    "fuzzy PID without prediction": {"law.type": "fuzzy_pid", "law.delay_compensation": False},
}
DELAYS_MS = [0, 100, 300, 500]
SEEDS = 10
DELAY, ERROR = "links.default.delay_ms", "error_y_m.max"
OUT = Path("runs/laws-by-delay")
STUDY = {
    "name": "laws-by-delay",
    "base": str(Path(__file__).parent.parent / "configs/paper.yaml"),
    "set": {
        "duration_s": 90,
        "expect": [],
        "links.default.jitter_ms": 10,  # without chance all seeds would fly the same
        "disturbances": [{"at_s": 60, "velocity_mps": [0.6, 0.6, 0]}],
    },
    "parameters": {"law": {"cases": LAWS}, DELAY: DELAYS_MS},
    "seeds": {"first": 1, "count": SEEDS},
    "metrics": ["error_x_m.max", ERROR, "margin_used"],
    "from_s": 60,
    "record": "none",
}


def draw(flights: pa.Table, path: Path) -> None:
    """Draw the median error over the delay, a line for each law, with bars from the best to the worst seed."""
    fig, axes = plt.subplots(layout="constrained")
    for place, law in enumerate(LAWS):
        shift_ms = 6 * (place - (len(LAWS) - 1) / 2)  # side by side
        medians, below, above = [], [], []
        for delay_ms in DELAYS_MS:
            errors = [row[ERROR] for row in flights.to_pylist() if (row["law"], row[DELAY]) == (law, delay_ms)]
            medians.append(statistics.median(errors))
            below.append(medians[-1] - min(errors))
            above.append(max(errors) - medians[-1])
        shifted_ms = [delay_ms + shift_ms for delay_ms in DELAYS_MS]
        axes.errorbar(shifted_ms, medians, yerr=(below, above), capsize=3, marker="o", label=law)
    axes.set(xlabel="delay each way, ms", ylabel="largest error to the side, m", yscale="log", xticks=DELAYS_MS)
    fig.legend(loc="outside lower center", ncols=2)
    fig.savefig(path)


if __name__ == "__main__":  # workers import this script
    table = gcs_formation.study(STUDY, OUT, overwrite=True)
    print((OUT / "table.md").read_text())
    draw(table, OUT / "laws-by-delay.png")
    print(f"{table.num_rows} flights: {OUT / 'flights.parquet'}, {OUT / 'laws-by-delay.png'}")
