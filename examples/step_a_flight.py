"""Step a flight: worsen a link, order a change, read errors, and repeat the flight from its record.

python examples/step_a_flight.py
"""

from pathlib import Path

import gcs_formation

SCENARIO = Path(__file__).parent / "diamond.yaml"


def main() -> None:
    worst_m = 0.0
    with gcs_formation.Flight(SCENARIO, clock="virtual", seed=3, until=40) as flight:
        ordered = False
        for tick in flight:
            for event in tick.events:
                print(f"{tick.time_s:6.1f} s  {event}")
            if tick.mission_time_s > 10 and not ordered:
                ordered = True
                flight.link(2, delay_ms=400, loss=0.1)
                flight.tell("shape line")
            if tick.phase == "flying":
                worst_m = max(worst_m, abs(tick.vehicles[2].error_m[0]))
    print(flight.summary.table())
    print(f"largest forward error of vehicle 2: {worst_m:.2f} m")
    print(f"the same flight again: gcs-formation run {flight.summary.run_dir}/run.yaml --clock virtual --until 40")


if __name__ == "__main__":
    main()
