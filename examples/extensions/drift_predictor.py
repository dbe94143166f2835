"""A predictor: equation (7), corrected by what it was off lately.

An aircraft whose model is a little wrong is off by much the same each time: what the prediction for now was off, when
now was measured, is expected of the next one, too.
"""

from collections.abc import Sequence

from pydantic import BaseModel, Field

from gcs_formation.extend import MeasuredVehicle, Predictor, State, register_predictor


@register_predictor("drift")  # law: {predictor: {type: drift}}
class Drift(Predictor):
    """Learns each vehicle's mean error of the predicted position, and takes it from the next predictions."""

    class Keys(BaseModel):
        """`law.predictor.parameters`."""

        share: float = Field(default=0.05, gt=0.0, le=1.0)  # of a tick's error that is estimated

    def begin(self) -> None:
        """Start without any errors."""
        self.before: dict[int | str | None, MeasuredVehicle] = {}
        self.off_m: dict[int | str | None, tuple[float, float]] = {}

    def take(self, vehicles: Sequence[MeasuredVehicle]) -> None:
        """Compare each new state with what was predicted for its time from the one before."""
        for now in vehicles:
            before = self.before.get(now.id)
            if before is not None and now.active and now.stamp_s > before.stamp_s:
                expected, (north_m, east_m) = before.by_model(now.stamp_s), self.off_m.get(now.id, (0.0, 0.0))
                north_m += self.keys.share * (now.state.north_m - expected.north_m - north_m)
                east_m += self.keys.share * (now.state.east_m - expected.east_m - east_m)
                self.off_m[now.id] = north_m, east_m
            self.before[now.id] = now

    def predict(self, vehicle: MeasuredVehicle, to_s: float, whose: MeasuredVehicle) -> State:  # noqa: ARG002
        """Return the state by equation (7), less what it is off a tick, for as many ticks as it is predicted."""
        state, (north_m, east_m) = vehicle.by_model(to_s), self.off_m.get(vehicle.id, (0.0, 0.0))
        return state._replace(north_m=state.north_m + north_m, east_m=state.east_m + east_m)
