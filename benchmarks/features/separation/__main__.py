"""Processor time of the separation rule in a tick: with distant slots, close slots, and a stranger head-on."""

from __future__ import annotations

from statistics import median
from time import process_time

import numpy as np

from gcs_formation.features.separation.conflict_resolution import resolve
from gcs_formation.studies.markdown import markdown
from tests.gcs_formation.features.separation.encounters import Vehicles, picture, wanted

COUNTS = (4, 100, 254)
SPACINGS_M = (30.0, 12.5)
STRANGER_AHEAD_M = 260.0
TIMES = 30


def formation(count: int, spacing_m: float, *, stranger: bool) -> Vehicles:
    """Return vehicles in rows, nearly equal in speed and heading; a stranger meets the first column head-on."""
    random, side = np.random.default_rng(1), int(np.ceil(np.sqrt(count)))
    noise = random.uniform((-0.3, -0.01), (0.3, 0.01), (count, 2)).tolist()
    rows = [
        [-spacing_m * (i // side), spacing_m * (i % side), 100.0, 22 + faster_mps, turned_rad, 0.0]
        for i, (faster_mps, turned_rad) in enumerate(noise)
    ]
    if stranger:
        rows[-1] = [STRANGER_AHEAD_M, spacing_m, 100.0, 22.0, np.pi, 0.0]
    return Vehicles(rows, commanded=[True] * (count - 1) + [not stranger])


def cost_ms(vehicles: Vehicles) -> tuple[float, int]:
    """Return the median processor time of a tick, ms, and how many vehicles manoeuvre."""
    took_s: list[float] = []
    manoeuvring = 0
    for _ in range(TIMES):
        seen = picture(vehicles, vehicles.state, wanted(vehicles, 0.0))
        begun = process_time()
        resolution = resolve(seen, np.zeros(len(vehicles.rows)))
        took_s.append(process_time() - begun)
        manoeuvring = int(np.count_nonzero(resolution.side))
    return 1e3 * median(took_s), manoeuvring


def main() -> None:
    """Print the table."""
    rows: list[list[str]] = []
    for count in COUNTS:
        level = [cost_ms(formation(count, spacing_m, stranger=False))[0] for spacing_m in SPACINGS_M]
        head_on_ms, manoeuvring = cost_ms(formation(count, SPACINGS_M[0], stranger=True))
        rows.append([str(count), *(f"{ms:.2f} ms" for ms in level), f"{head_on_ms:.1f} ms, {manoeuvring} manoeuvre"])
    heads = ["vehicles", *(f"in slots {spacing_m:g} m apart" for spacing_m in SPACINGS_M), "one head-on"]
    print(markdown(heads, rows))


if __name__ == "__main__":
    main()
