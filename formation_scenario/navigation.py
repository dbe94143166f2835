"""Keys of the vehicles' navigation: the errors of their telemetry."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field, Tag

from formation_scenario.fields import (
    EXTENSION,
    OF_AN_EXTENSION,
    WHOLE,
    Allowed,
    Keys,
    Later,
    NonNegative,
    Number,
    Open,
    OwnKeys,
    Positive,
    Rate,
    key,
    one_of,
)

NAVIGATIONS: Final = ("truth", "noisy", "estimator", "ins")
SOURCES = (
    "where its telemetry comes from: the true state, the true state with noise, the autopilot's own estimate, "
    "or inertial navigation"
)


OF_FAMILY = "as its family's simulator has it"


class TrueNavigation(Keys):
    """Vehicles know their state exactly."""

    source: Literal["truth"] = key("truth", SOURCES)


class NoisyNavigation(Keys):
    """Telemetry carries sensor errors; the vehicle's own control loops use the true state."""

    source: Literal["noisy"] = key(..., SOURCES)
    rate_hz: Rate = key(10.0, "new errors a second, as a GNSS receiver's, Hz", 5)
    position_sigma_m: NonNegative = key(0.3, "standard deviation of position north, east and up, m", 1)
    velocity_sigma_mps: NonNegative = key(0.1, "the same of ground velocity, m/s", 0.3)
    airspeed_sigma_mps: NonNegative = key(0.2, "the same of airspeed, m/s", 0.5)
    heading_sigma_deg: NonNegative = key(0.5, "the same of heading, degrees", 2)
    correlation_s: NonNegative = key(0.0, "time constant of first-order Gauss-Markov errors, s; 0: white", 30)
    outlier_share: Annotated[NonNegative, Field(le=1.0)] = key(
        0.0, "share of the samples whose position is `outlier_m` off to some side", 0.05
    )
    outlier_m: NonNegative = key(20.0, "how far those are off, m", 50)


class EstimatorNavigation(Keys):
    """The autopilot's own estimate, by which its control loops fly too; errors as its family's simulator has them."""

    source: Literal["estimator"] = key(..., SOURCES)
    air: Literal["calm", "rough"] = key(
        "calm", "of which air the family's errors are; rough has gusts of 1 m/s", "rough"
    )
    velocity_sigma_mps: NonNegative | None = key(
        None, "standard deviation of ground velocity north and east, m/s", 0.1, derived=OF_FAMILY
    )
    velocity_correlation_s: Positive | None = key(None, "time constant of that, s", 1.3, derived=OF_FAMILY)
    climb_sigma_mps: NonNegative | None = key(
        None, "standard deviation of the vertical velocity, m/s", 0.1, derived=OF_FAMILY
    )
    climb_correlation_s: Positive | None = key(None, "time constant of that, s", 2, derived=OF_FAMILY)
    position_sigma_m: NonNegative | None = key(
        None, "standard deviation of position north and east, m; changes as velocity does", 0.06, derived=OF_FAMILY
    )
    height_sigma_m: NonNegative | None = key(
        None, "the same of height, m; changes as the vertical velocity does", 0.13, derived=OF_FAMILY
    )
    heading_offset_deg: Number | None = key(
        None, "by how much its heading is wrong all the time, degrees", 0.4, derived=OF_FAMILY
    )
    heading_sigma_deg: NonNegative | None = key(
        None, "standard deviation of heading about that, degrees", 0.4, derived=OF_FAMILY
    )
    heading_correlation_s: Positive | None = key(None, "time constant of that, s", 10, derived=OF_FAMILY)
    airspeed_sigma_mps: NonNegative | None = key(
        None, "standard deviation of airspeed, white, m/s", 0.2, derived=OF_FAMILY
    )


MAX_ACCEL_UG, MAX_GYRO_DEG_PER_H = 1e5, 3600.0
"""A tenth of gravity and a degree per second: navigation sensors are never worse."""
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


OF_THE_GRADE = "of the grade"


class InertialSensorKeys(Keys):
    """Accelerometers and gyroscopes along the body axes; keys that aren't given are the grade's."""

    accel_bias_ug: AccelBiases | None = key(
        None, "constant bias of every accelerometer, or of each, micro-g", 200, derived=OF_THE_GRADE
    )
    gyro_bias_deg_per_h: GyroBiases | None = key(
        None, "constant bias of every gyroscope, or of each, degrees an hour", [0.1, 0.1, 0.2], derived=OF_THE_GRADE
    )
    accel_noise_ug_per_rthz: Annotated[NonNegative, Field(le=MAX_ACCEL_UG)] | None = key(
        None, "white noise, micro-g/sqrt(Hz)", 30, derived=OF_THE_GRADE
    )
    gyro_noise_deg_per_rth: Annotated[NonNegative, Field(le=MAX_NOISE_DEG_PER_RTH)] | None = key(
        None, "angle random walk, deg/sqrt(h)", 0.01, derived=OF_THE_GRADE
    )


class GnssKeys(Keys):
    """A GNSS receiver that aids inertial navigation, with white errors."""

    rate_hz: Annotated[float, Field(strict=True, gt=0.0, le=10.0)] = key(1.0, "measurements a second, Hz", 5)
    position_sigma_m: Positive = key(1.5, "standard deviation of position north and east, m", 0.5)
    height_sigma_m: Positive = key(3.0, "the same of height, m", 1)
    velocity_sigma_mps: Positive = key(0.1, "the same of velocity north, east and up, m/s", 0.05)


class BarometerKeys(Keys):
    """A barometric altimeter that aids inertial navigation, with white errors."""

    rate_hz: Annotated[float, Field(strict=True, gt=0.0, le=10.0)] = key(1.0, "measurements a second, Hz", 5)
    height_sigma_m: Positive = key(1.0, "standard deviation of height, m", 2)


class InertialNavigation(Keys):
    """Strap-down inertial navigation after an alignment; telemetry carries its errors."""

    source: Literal["ins"] = key(..., SOURCES)
    grade: Grade = key("aviation", "grade that fills what isn't given of sensors", "tactical")
    sensors: InertialSensorKeys = InertialSensorKeys.model_construct()
    biases: Literal["keys", "random"] = key(
        "keys",
        "keys | random: biases as the keys have them, or drawn by the seed for each vehicle, "
        "with the keys' root mean square as standard deviation",
    )
    airspeed_sigma_mps: NonNegative = key(0.2, "standard deviation of the measured airspeed, m/s")
    alignment_s: Annotated[int, Field(strict=True, ge=10, le=7200), WHOLE] = key(
        900, "how long the vehicle stands and aligns, s", 600
    )
    flight_start: Literal["exact", "aligned"] = key(
        "exact", "the flight starts from the true state, or from the alignment's attitude"
    )
    aiding: Literal["none", "baro", "gnss"] = key("none", "what aids it", "gnss")
    gnss: GnssKeys = GnssKeys.model_construct()
    barometer: BarometerKeys = BarometerKeys.model_construct()


class OwnNavigation(Keys):
    """A source that an extension registers by this name; the station takes it to be as good as the emulators' own."""

    source: Annotated[str, Open("a source that an extension registers")] = key(..., SOURCES, "camera")
    parameters: OwnKeys = key(None, OF_AN_EXTENSION, {})


Navigation = Annotated[
    Annotated[TrueNavigation, Tag("truth")]
    | Annotated[Later[NoisyNavigation], Tag("noisy")]
    | Annotated[Later[EstimatorNavigation], Tag("estimator")]
    | Annotated[Later[InertialNavigation], Tag("ins")]
    | Annotated[Later[OwnNavigation], Tag(EXTENSION)],
    one_of("source", "truth", NAVIGATIONS),
]
