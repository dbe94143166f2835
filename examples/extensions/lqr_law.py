"""A law for each follower: feedback of the mixed errors and their rates, with an integral that doesn't wind up."""

from pydantic import BaseModel, Field

from gcs_formation.extend import FollowerLaw, register_law

Vector3 = tuple[float, float, float]
GAINS = (1.2, 2.6), (1.0, 1.6), (1.6, 3.6)
"""Of error and rate: speed, heading, height."""


@register_law("lqr")  # law.type: lqr
class Lqr(FollowerLaw):
    """u = share (k e + k_d e') + k_i times the integral of e, for each channel."""

    class Keys(BaseModel):
        """`law.parameters`."""

        share: float = Field(default=1.0, gt=0.0, le=2.0)
        integral: float = Field(default=0.02, ge=0.0)

    def begin(self) -> None:
        """Start with empty integrals."""
        self.integrals = [0.0, 0.0, 0.0]

    def feedback(self, error: Vector3, error_rate: Vector3, dt_s: float) -> list[float]:
        """Return what is added to the feed-forward: speed m/s, heading rad, height m."""
        output = list[float]()
        for channel, (of_error, of_rate) in enumerate(GAINS):
            if not self.replaced[channel] and self.excess[channel] == 0.0:
                self.integrals[channel] += error[channel] * dt_s
            proportional = of_error * error[channel] + of_rate * error_rate[channel]
            output.append(self.keys.share * proportional + self.keys.integral * self.integrals[channel])
        return output

    def reset(self) -> None:
        """Forget the integrals."""
        self.begin()
