"""A delay and loss process of a link: a radio whose losses grow with distance, and that the ground can shade."""

import math

from pydantic import BaseModel, Field

from gcs_formation.extend import Carried, LinkProcess, register_link_process

SAMPLES = 8
"""Places between the antennas at which the ground is looked up."""


@register_link_process("radio")  # links.default: {process: radio, parameters: {range_m: 4000}}
class Radio(LinkProcess):
    """Loses nothing near the station, and everything beyond its range or behind a hill."""

    class Keys(BaseModel):
        """`parameters` beside `process`."""

        range_m: float = Field(default=4000.0, gt=0.0)
        delay_ms: float = Field(default=50.0, ge=0.0)
        jitter_ms: float = Field(default=20.0, ge=0.0)

    def delay_s(self, carried: Carried) -> float | None:
        """Return a uniform delay, or None for a datagram that is lost."""
        away = math.dist(carried.station, carried.vehicle) / self.keys.range_m
        if self.random.random() < away**8 or self._shaded(carried):
            return None
        return 1e-3 * (self.keys.delay_ms + self.keys.jitter_ms * self.random.random())

    def _shaded(self, carried: Carried) -> bool:
        here, there = carried.station, carried.vehicle
        for sample in range(1, SAMPLES):
            share = sample / SAMPLES
            north_m, east_m, height_m = (a + share * (b - a) for a, b in zip(here, there, strict=True))
            if self.ground_m(north_m, east_m) > height_m:
                return True
        return False
