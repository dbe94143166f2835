# Compiled by mypyc: it runs every tick.

"""Compares the noise of telemetry with the declared one, and airspeeds with what velocity and wind show."""

from __future__ import annotations

from typing import Final

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.estimation.noise_and_plausibility import QUANTITIES, VehicleNoise
from gcs_formation.recorder import Detail

NOISE_OFF: Final = 1.8
"""Ratio to the declared noise, or its inverse, from which a difference is reported. Tuned: ratio; 1.5 to 3; shown by
`pytest tests/gcs_formation/features/telemetry_noise`."""
NOISE_BACK: Final = 1.4
"""Ratio below which the noise is as declared again. Tuned: ratio; 1.2 to below `NOISE_OFF`; shown by `pytest
tests/gcs_formation/features/telemetry_noise`."""
UNITS: Final = ("m", "m", "m/s", "m/s", "m/s", "rad")
ACCEPTED_AGAIN: Final = "what it measures is accepted again"


class TelemetryNoise(Stage):
    """Reports whose noise isn't as declared or whose airspeed isn't plausible, and when that ends.

    It only reports, and so stands anywhere.
    """

    name = "telemetry_noise"
    when = EACH_SECOND
    after = (
        "own_parts",
        "budget",
    )

    def __init__(self, cycle: Cycle) -> None:
        """Begin with noise as declared and plausible airspeeds."""
        self._vehicles, self._log_event = cycle.vehicles, cycle.log_event
        self._off, self._unbelieved = set[VehicleId](), set[VehicleId]()

    def run(self, cycle: Cycle) -> None:
        """Compare noise as estimated with noise as declared, then airspeeds with the synthetic ones."""
        self.watch_noise(cycle.now, [each.noise for each in cycle.controller.estimator.filters])
        self.watch_airspeeds(cycle.now)

    def watch_noise(self, now: Instant, noise: list[VehicleNoise]) -> None:
        """Compare measured noise, which the law uses, with the declared one; report the quantity that differs most."""
        for identity, vehicle in self._vehicles.items():
            ratios, was_off, worst, largest = noise[vehicle.index].ratios(), identity in self._off, 0, 1.0
            for index, each in enumerate(ratios):
                if max(each, 1.0 / each) > largest:
                    worst, largest = index, max(each, 1.0 / each)
            if not was_off and largest >= NOISE_OFF:
                self._off.add(identity)
                sigma, ratio = noise[vehicle.index].sigma()[worst], ratios[worst]
                text = f"{QUANTITIES[worst]} is {ratio:.1f} times as noisy as declared: {sigma:.2g} {UNITS[worst]}"
                self._log_event(now, "noise", text, vehicle, {"ratio": ratio})
            elif was_off and largest < NOISE_BACK:
                self._off.remove(identity)
                details: dict[str, Detail] = {"ratio": ratios[worst]}
                self._log_event(now, "noise", "is as noisy as declared again", vehicle, details)

    def watch_airspeeds(self, now: Instant) -> None:
        """Report which measured airspeeds aren't plausible."""
        for identity, vehicle in self._vehicles.items():
            check, was_plausible = vehicle.sampler.airspeed_check, identity not in self._unbelieved
            if check is None or check.accepted == was_plausible:
                continue
            if was_plausible:
                self._unbelieved.add(identity)
                shown = f"velocity over ground and wind show {check.synthetic_mps:.1f} m/s"
                text = f"the {vehicle.telemetry.airspeed_mps:.1f} m/s that it measures is rejected: {shown}"
                self._log_event(now, "airspeed", text, vehicle, {"begins": True})
            else:
                self._unbelieved.remove(identity)
                self._log_event(now, "airspeed", ACCEPTED_AGAIN, vehicle, {"begins": False})
