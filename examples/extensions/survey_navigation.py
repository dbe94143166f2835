"""A navigation source: an origin that was surveyed wrongly, and a compass that swings."""

from pydantic import BaseModel, Field

from gcs_formation.extend import Measured, NavigationSource, register_navigation


@register_navigation("survey")  # navigation: {source: survey, parameters: {north_m: 3}}
class Survey(NavigationSource):
    """Places that are all off by the same, and headings with white noise."""

    class Keys(BaseModel):
        """`parameters` beside `source`."""

        north_m: float = 1.0
        east_m: float = 0.0
        heading_sigma_rad: float = Field(default=0.002, ge=0.0)

    def measure(self, true: Measured, time_s: float) -> Measured:
        """Return what telemetry has at a time since the run's start."""
        del time_s  # it is the same at all times
        return true._replace(
            north_m=true.north_m + self.keys.north_m,
            east_m=true.east_m + self.keys.east_m,
            heading_rad=true.heading_rad + self.keys.heading_sigma_rad * self.random.standard_normal(),
        )
