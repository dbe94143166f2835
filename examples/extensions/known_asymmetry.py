"""An estimator of delays: a link of which it is known how its round trip is shared, as over a satellite."""

from pydantic import BaseModel, Field

from gcs_formation.extend import DelayEstimator, RoundTrip, register_delay_estimator


@register_delay_estimator("known_asymmetry")  # telemetry: {clock: known_asymmetry, parameters: {up_share: 0.8}}
class KnownAsymmetry(DelayEstimator):
    """Takes a share of the median round trip for the way up."""

    class Keys(BaseModel):
        """`telemetry.parameters`."""

        up_share: float = Field(ge=0.0, le=1.0)

    def begin(self) -> None:
        """Start without round trips."""
        self.recent_s: list[float] = []

    def measure(self, trip: RoundTrip) -> tuple[float, float]:
        """Return the delays up and down, s."""
        self.recent_s = [*self.recent_s[-11:], trip.received_s - trip.sent_s - trip.loop_s / 2]
        trip_s = max(0.0, sorted(self.recent_s)[len(self.recent_s) // 2])
        return self.keys.up_share * trip_s, (1.0 - self.keys.up_share) * trip_s

    def reset(self) -> None:
        """Forget the round trips."""
        self.begin()
