"""Says when a vehicle's telemetry is noisier, or quieter, than the scenario declares."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from airlink.clock import Instant
from airlink.identity import VehicleId
from gcs_formation.estimation.noise import QUANTITIES, NoiseEstimate
from gcs_formation.recorder import Note
from gcs_formation.vehicle.vehicle import Vehicle

OFF = 1.8
"""Ratio to the declared noise, or its inverse, from which it isn't as declared."""
BACK = 1.4
"""Ratio below which it is again."""
UNITS = ("m", "m", "m/s", "m/s", "m/s", "rad")


class NoiseWatch:
    """Compares the noise that is seen with the declared one; the law goes by what is seen."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], columns: Mapping[VehicleId, int], note: Note) -> None:
        """Watch `vehicles`, whose columns in the estimate are `columns`."""
        self._vehicles, self._columns, self._note = vehicles, columns, note
        self._off: set[VehicleId] = set()

    def watch(self, now: Instant, noise: NoiseEstimate) -> None:
        """Look once a second; of a vehicle whose noise is off, the quantity that is farthest off is named."""
        for identity, column in self._columns.items():
            ratios = noise.ratios[:, column]
            worst = int(np.abs(np.log(ratios)).argmax())
            ratio, was_off = float(ratios[worst]), identity in self._off
            apart = max(ratio, 1.0 / ratio)
            if not was_off and apart >= OFF:
                self._off.add(identity)
                sigma = float(noise.sigma[worst, column])
                text = f"{QUANTITIES[worst]} is {ratio:.1f} times as noisy as declared: {sigma:.2g} {UNITS[worst]}"
                self._note(now, "noise", text, self._vehicles[identity], {"ratio": ratio})
            elif was_off and apart < BACK:
                self._off.remove(identity)
                self._note(now, "noise", "is as noisy as declared again", self._vehicles[identity], {"ratio": ratio})
