"""Motion of a rigid body on a flat Earth, what its inertial sensors and its airspeed sensor measure, and the ground.

Frames: body axes forward, right, down; the Earth's north, east, down. Source: Beard and McLain, Small Unmanned
Aircraft (2012), equations (3.14) to (3.17), with a diagonal inertia.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Final

from airlink.random_streams import random_stream
from flight_model.autopilot_model import within, wrap
from flight_model.earth import air_density_kgm3
from flight_model.energy import GRAVITY_MPS2
from flight_model.flight_state import FlightState
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.config import VehicleConfig

ACCEL_NOISE_MPS2: Final = 0.3
GYRO_NOISE_RPS: Final = math.radians(0.1)
"""Standard deviations at full throttle, of white noise at each step; of ArduPilot's simulator."""
ALOFT_M: Final = 1.0
"""Height above the ground from which a vehicle counts as in the air."""
MAX_SENSED_MPS2: Final = 16.0 * GRAVITY_MPS2
GROUND_S: Final = 0.1
"""Time constant with which the ground levels what touches it."""
GRIP_MPS2: Final = 50.0
"""Greatest deceleration by wheels sideways, and by skids: they hold in any wind, and stop what lands askew."""
BOUNDARY_LAYER_M, LOWEST_M, SHEAR = 10.0, 0.1, 1.0 / 7.0
"""Heights above the ground below which the wind is weaker, and of a vehicle that stands, and the exponent: wind speeds
are those at 10 m (of open country)."""
BLOCK: Final = 1024
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""From body to Earth axes, scalar part first."""


class Sensed:
    """What sensors measure after a step."""

    __slots__ = ("accel_mps2", "airspeed_mps", "gyro_rps")

    def __init__(self, accel_mps2: Vector, gyro_rps: Vector, airspeed_mps: float) -> None:
        """Take specific force and rates in body axes, and true airspeed along the nose."""
        self.accel_mps2 = accel_mps2
        self.gyro_rps = gyro_rps
        self.airspeed_mps = airspeed_mps


class RigidBody(InAir):
    """A rigid body that stands on level ground until its forces lift it."""

    mass_kg: float
    inertia_kgm2: Vector
    """Principal moments of inertia, about body axes."""

    def __init__(self, config: VehicleConfig, wind_mps: Vector, seed: int, field_m: float, step_s: float) -> None:
        """Stand at the configured start; `field_m` is the origin's height above sea level, `step_s` the time step."""
        start = config.start
        state = FlightState(start.north_m, start.east_m, start.height_m, 0.0, 0.0, start.heading_rad, 0.0, 0.0)
        super().__init__(config.model.autopilot(), state, wind_mps)
        self.hovers: bool = config.model.hovers
        self.ground_m: float = start.height_m
        self._field_m, self.step_s = field_m, step_s
        self.velocity_mps: Vector = (0.0, 0.0, 0.0)
        """Over ground: north, east, down."""
        self.attitude: Quaternion = (math.cos(start.heading_rad / 2.0), 0.0, 0.0, math.sin(start.heading_rad / 2.0))
        self.rates_rps: Vector = (0.0, 0.0, 0.0)
        self.density: float = air_density_kgm3(field_m)
        self._random = random_stream(seed, "inertial sensors", *config.identity)
        self._noise: list[list[float]] = []
        self._drawn: int = BLOCK

    @property
    def airborne(self) -> bool:
        """Whether it is off the ground."""
        return self.state.height_m - self.ground_m > ALOFT_M

    @property
    def on_ground(self) -> bool:
        """Whether it touches the ground."""
        return self.state.height_m <= self.ground_m

    def ground_velocity(self) -> Vector:
        """Return ground velocity north, east and down, m/s."""
        return self.velocity_mps

    @abstractmethod
    def throttle(self) -> float:
        """Return the share of full power, which shakes the sensors."""

    @abstractmethod
    def act(self, outputs_us: Sequence[int]) -> None:
        """Take servo outputs, as pulse widths in µs, for a step; 0: no pulse."""

    @abstractmethod
    def forces(self, air_mps: Vector) -> tuple[Vector, Vector]:
        """Return force, N, and moment, N m, in body axes, without gravity; `air_mps`: its velocity through the air."""

    @abstractmethod
    def touch(self) -> None:
        """Let the ground act on velocity, attitude and rates, while it touches it."""

    def update_density(self) -> None:
        """Take the density of the air at its height; before each cycle of several steps."""
        self.density = air_density_kgm3(self._field_m + self.state.height_m)

    def step(self, outputs_us: Sequence[int]) -> Sensed:
        """Move for a step with servo outputs, and return what sensors then measure."""
        state, before, step_s = self.state, self.velocity_mps, self.step_s
        self.act(outputs_us)
        force, moment = self.forces(self._through_air())
        x, y, z = to_earth(self.attitude, force)
        north = before[0] + step_s * x / self.mass_kg
        east = before[1] + step_s * y / self.mass_kg
        down = before[2] + step_s * (z / self.mass_kg + GRAVITY_MPS2)
        self._spin(moment)
        if self.on_ground:
            self.velocity_mps = (north, east, min(down, 0.0))
            self.touch()
        else:
            self.velocity_mps = (north, east, down)
        p, q, r = self.rates_rps
        self.attitude = rotated(self.attitude, p, q, r, step_s)
        north, east, down = self.velocity_mps
        state.north_m += step_s * north
        state.east_m += step_s * east
        state.height_m = max(state.height_m - step_s * down, self.ground_m)
        return self._sense(before)

    def settle(self) -> None:
        """Bring the state up to date that environment and ground truth read; after each cycle."""
        state, (north, east, down) = self.state, self.velocity_mps
        air = self._through_air()
        state.climb_mps = -down
        state.airspeed_mps = math.sqrt(air[0] * air[0] + air[1] * air[1] + air[2] * air[2])
        nose_rad = yaw_of(self.attitude)
        state.heading_rad += wrap(self.axis_rad(nose_rad, north, east) - state.heading_rad)

    def axis_rad(self, nose_rad: float, north_mps: float, east_mps: float) -> float:  # noqa: ARG002 - as hovering ones'
        """Return the axis of the slots behind it."""
        return nose_rad

    def _through_air(self) -> Vector:
        north, east, down = self.velocity_mps
        share = wind_share(self.state.height_m - self.ground_m)
        air_down_mps = 0.0 if self.on_ground else self.air_down_mps
        relative = (north - share * self.air_north_mps, east - share * self.air_east_mps, down - air_down_mps)
        return to_body(self.attitude, relative)

    def _spin(self, moment: Vector) -> None:
        """Change the rates for a step, by Euler's equation."""
        (ix, iy, iz), (p, q, r) = self.inertia_kgm2, self.rates_rps
        self.rates_rps = (
            p + self.step_s * (moment[0] - (iz - iy) * q * r) / ix,
            q + self.step_s * (moment[1] - (ix - iz) * r * p) / iy,
            r + self.step_s * (moment[2] - (iy - ix) * p * q) / iz,
        )

    def _sense(self, before: Vector) -> Sensed:
        """Measure what the step did, including the ground's part in it."""
        now, noise = self.velocity_mps, self._next_noise()
        change = (
            (now[0] - before[0]) / self.step_s,
            (now[1] - before[1]) / self.step_s,
            (now[2] - before[2]) / self.step_s - GRAVITY_MPS2,
        )
        x, y, z = to_body(self.attitude, change)
        shaken, turned = self.throttle() * ACCEL_NOISE_MPS2, self.throttle() * GYRO_NOISE_RPS
        p, q, r = self.rates_rps
        accel = (_bounded(x + shaken * noise[0]), _bounded(y + shaken * noise[1]), _bounded(z + shaken * noise[2]))
        gyro = (p + turned * noise[3], q + turned * noise[4], r + turned * noise[5])
        return Sensed(accel, gyro, max(self._through_air()[0], 0.0))

    def _next_noise(self) -> list[float]:
        if self._drawn == BLOCK:
            self._noise, self._drawn = self._random.standard_normal((BLOCK, 6)).tolist(), 0
        self._drawn += 1
        return self._noise[self._drawn - 1]


def wind_share(above_ground_m: float) -> float:
    """Return the share of the wind that blows at a height: less near the ground, by the power law of 1/7."""
    if above_ground_m >= BOUNDARY_LAYER_M:
        return 1.0
    return math.pow(max(above_ground_m, LOWEST_M) / BOUNDARY_LAYER_M, SHEAR)


def gripped(speed_mps: float, step_s: float) -> float:
    """Return a speed over ground after a step on something that doesn't roll that way."""
    return speed_mps - within(speed_mps, -GRIP_MPS2 * step_s, GRIP_MPS2 * step_s)


def _bounded(accel_mps2: float) -> float:
    return within(accel_mps2, -MAX_SENSED_MPS2, MAX_SENSED_MPS2)


def to_earth(attitude: Quaternion, vector: Vector) -> Vector:
    """Return a vector of body axes in Earth axes."""
    w, x, y, z = attitude
    a, b, c = vector
    return (
        (1.0 - 2.0 * (y * y + z * z)) * a + 2.0 * (x * y - w * z) * b + 2.0 * (x * z + w * y) * c,
        2.0 * (x * y + w * z) * a + (1.0 - 2.0 * (x * x + z * z)) * b + 2.0 * (y * z - w * x) * c,
        2.0 * (x * z - w * y) * a + 2.0 * (y * z + w * x) * b + (1.0 - 2.0 * (x * x + y * y)) * c,
    )


def to_body(attitude: Quaternion, vector: Vector) -> Vector:
    """Return a vector of Earth axes in body axes."""
    w, x, y, z = attitude
    return to_earth((w, -x, -y, -z), vector)


def rotated(attitude: Quaternion, p: float, q: float, r: float, dt_s: float) -> Quaternion:
    """Return the attitude after turning at body rates, rad/s, for a time, s."""
    rate_rps = math.sqrt(p * p + q * q + r * r)
    half_rad = 0.5 * rate_rps * dt_s
    share = 0.5 * dt_s if half_rad < 1e-9 else math.sin(half_rad) / rate_rps
    c, a, b, d = math.cos(half_rad), p * share, q * share, r * share
    w, x, y, z = attitude
    turned = (
        w * c - x * a - y * b - z * d,
        w * a + x * c + y * d - z * b,
        w * b - x * d + y * c + z * a,
        w * d + x * b - y * a + z * c,
    )
    scale = 1.0 / math.sqrt(turned[0] ** 2 + turned[1] ** 2 + turned[2] ** 2 + turned[3] ** 2)
    return turned[0] * scale, turned[1] * scale, turned[2] * scale, turned[3] * scale


def yaw_of(attitude: Quaternion) -> float:
    """Return the nose's direction, clockwise from north, rad."""
    w, x, y, z = attitude
    return math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


def pitch_of(attitude: Quaternion) -> float:
    """Return the nose's elevation, rad."""
    w, x, y, z = attitude
    return math.asin(within(2.0 * (w * y - x * z), -1.0, 1.0))


def bank_of(attitude: Quaternion) -> float:
    """Return the bank, right wing down, rad."""
    w, x, y, z = attitude
    return math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
