"""Keys of the vehicles' navigation: how well their telemetry knows their state."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, Tag

from formation_scenario.fields import Allowed, Keys, NonNegative, Number, Positive, Rate, derived, one_of

SOURCES = "where its telemetry comes from: the true state, the true state with noise, or inertial navigation"


class TrueNavigation(Keys):
    """Vehicles know their state exactly."""

    source: Literal["truth"] = Field(default="truth", description=SOURCES)


class NoisyNavigation(Keys):
    """Telemetry carries sensor errors; the vehicle's own control loops use the true state."""

    source: Literal["noisy"] = Field(description=SOURCES)
    rate_hz: Rate = Field(default=10.0, description="new errors a second, as a GNSS receiver's, Hz", examples=[5])
    position_sigma_m: NonNegative = Field(
        default=0.3, description="standard deviation of position north, east and up, m", examples=[1]
    )
    velocity_sigma_mps: NonNegative = Field(default=0.1, description="the same of ground velocity, m/s", examples=[0.3])
    airspeed_sigma_mps: NonNegative = Field(default=0.2, description="the same of airspeed, m/s", examples=[0.5])
    heading_sigma_deg: NonNegative = Field(default=0.5, description="the same of heading, degrees", examples=[2])
    correlation_s: NonNegative = Field(
        default=0.0, description="time constant of first-order Gauss-Markov errors, s; 0: white", examples=[30]
    )
    outlier_share: Annotated[NonNegative, Field(le=1.0)] = Field(
        default=0.0, description="share of the samples whose position is `outlier_m` off to some side", examples=[0.05]
    )
    outlier_m: NonNegative = Field(default=20.0, description="how far those are off, m", examples=[50])


MAX_ACCEL_UG, MAX_GYRO_DEG_PER_H = 1e5, 3600.0
"""A tenth of gravity and a degree per second: no sensor that is used for navigation is worse."""
MAX_NOISE_DEG_PER_RTH = 100.0
AccelBias = Annotated[Number, Field(ge=-MAX_ACCEL_UG, le=MAX_ACCEL_UG)]
GyroBias = Annotated[Number, Field(ge=-MAX_GYRO_DEG_PER_H, le=MAX_GYRO_DEG_PER_H)]
AccelBiases: TypeAlias = Annotated[
    AccelBias | tuple[AccelBias, AccelBias, AccelBias],
    Allowed(f"a number, or a list of 3 numbers (right, forward, up), up to ±{MAX_ACCEL_UG:g}"),
]
GyroBiases: TypeAlias = Annotated[
    GyroBias | tuple[GyroBias, GyroBias, GyroBias],
    Allowed(f"a number, or a list of 3 numbers (right, forward, up), up to ±{MAX_GYRO_DEG_PER_H:g}"),
]
Grade = Literal["ideal", "navigation", "aviation", "intermediate", "tactical"]
GRADES: dict[str, tuple[float, float, float, float]] = {
    "ideal": (0.0, 0.0, 0.0, 0.0),
    "navigation": (50.0, 0.01, 20.0, 0.002),
    "aviation": (100.0, 0.02, 20.0, 0.002),
    "intermediate": (1000.0, 0.1, 50.0, 0.01),
    "tactical": (2000.0, 10.0, 100.0, 0.1),
}
"""Biases of accelerometers, micro-g, and gyroscopes, degrees per hour, then their noise as in the keys below.

The grades are those of Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems (2013),
section 4.1.
"""


OF_THE_GRADE = derived("of the grade")


class InertialSensorKeys(Keys):
    """Accelerometers and gyroscopes along the body axes; keys that aren't given are the grade's."""

    accel_bias_ug: AccelBiases | None = Field(
        default=None,
        description="constant bias of every accelerometer, or of each, micro-g",
        json_schema_extra=OF_THE_GRADE,
        examples=[200],
    )
    gyro_bias_deg_per_h: GyroBiases | None = Field(
        default=None,
        description="constant bias of every gyroscope, or of each, degrees an hour",
        json_schema_extra=OF_THE_GRADE,
        examples=[[0.1, 0.1, 0.2]],
    )
    accel_noise_ug_per_rthz: Annotated[NonNegative, Field(le=MAX_ACCEL_UG)] | None = Field(
        default=None, description="white noise, micro-g/sqrt(Hz)", json_schema_extra=OF_THE_GRADE, examples=[30]
    )
    gyro_noise_deg_per_rth: Annotated[NonNegative, Field(le=MAX_NOISE_DEG_PER_RTH)] | None = Field(
        default=None, description="angle random walk, deg/sqrt(h)", json_schema_extra=OF_THE_GRADE, examples=[0.01]
    )


class GnssKeys(Keys):
    """A GNSS receiver that aids inertial navigation, with white errors."""

    rate_hz: Annotated[float, Field(strict=True, gt=0.0, le=10.0)] = Field(
        default=1.0, description="measurements a second, Hz", examples=[5]
    )
    position_sigma_m: Positive = Field(
        default=1.5, description="standard deviation of position north and east, m", examples=[0.5]
    )
    height_sigma_m: Positive = Field(default=3.0, description="the same of height, m", examples=[1])
    velocity_sigma_mps: Positive = Field(
        default=0.1, description="the same of velocity north, east and up, m/s", examples=[0.05]
    )


class BarometerKeys(Keys):
    """A barometric altimeter that aids inertial navigation, with white errors."""

    rate_hz: Annotated[float, Field(strict=True, gt=0.0, le=10.0)] = Field(
        default=1.0, description="measurements a second, Hz", examples=[5]
    )
    height_sigma_m: Positive = Field(default=1.0, description="standard deviation of height, m", examples=[2])


class InertialNavigation(Keys):
    """Strap-down inertial navigation after an alignment; telemetry carries its errors."""

    source: Literal["ins"] = Field(description=SOURCES)
    grade: Grade = Field(
        default="aviation", description="grade that fills what isn't given of sensors", examples=["tactical"]
    )
    sensors: InertialSensorKeys = InertialSensorKeys()
    biases: Literal["keys", "random"] = Field(
        default="keys",
        description="keys | random: biases as the keys have them, or drawn by the seed for each vehicle, "
        "with the keys' root mean square as standard deviation",
    )
    airspeed_sigma_mps: NonNegative = Field(default=0.2, description="standard deviation of the measured airspeed, m/s")
    alignment_s: Annotated[int, Field(strict=True, ge=10, le=7200)] = Field(
        default=900, description="how long the vehicle stands and aligns, s", examples=[600]
    )
    flight_start: Literal["exact", "aligned"] = Field(
        default="exact",
        description="the flight starts from the true state, or from the alignment's attitude",
    )
    aiding: Literal["none", "baro", "gnss"] = Field(default="none", description="what aids it", examples=["gnss"])
    gnss: GnssKeys = GnssKeys()
    barometer: BarometerKeys = BarometerKeys()


Navigation = Annotated[
    Annotated[TrueNavigation, Tag("truth")]
    | Annotated[NoisyNavigation, Tag("noisy")]
    | Annotated[InertialNavigation, Tag("ins")],
    one_of("source", default="truth"),
]
