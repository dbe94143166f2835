"""A fixed wing with aileron, elevator, throttle and rudder on outputs 1 to 4.

The aerodynamic model is that of Beard and McLain, Small Unmanned Aircraft (2012), section 4.2, with a lift curve that
goes over into that of a flat plate beyond the stall (equation 4.9). Its coefficients and its mass are those of the
aeroplane in ArduPilot's own simulator, which has them from last_letter's Skywalker (libraries/SITL/SIM_Plane.h), for
surface deflections from -1 to 1 and unit moments of inertia.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from flight_model.autopilot_model import within
from flight_model.earth import air_density_kgm3
from flight_model.energy import GRAVITY_MPS2
from sim_vehicles.airframe.rigid_body.motion import (
    GROUND_S,
    RigidBody,
    Vector,
    bank_of,
    gripped,
    pitch_of,
    yaw_of,
)

MASS_KG: Final = 2.0
AREA_M2, SPAN_M, CHORD_M = 0.45, 1.88, 0.24
LIFT_0, LIFT_ALPHA = 0.56, 6.9
STALL_RAD, BLENDING = 0.4712, 50.0
PARASITIC_DRAG, OSWALD = 0.1, 0.9
SIDE_BETA, SIDE_RUDDER = -0.98, -0.2
ROLL_BETA, ROLL_P, ROLL_R, ROLL_AILERON, ROLL_RUDDER = -0.12, -1.0, 0.14, 0.25, -0.037
PITCH_0, PITCH_ALPHA, PITCH_Q, PITCH_ELEVATOR = 0.045, -0.7, -20.0, 1.0
YAW_BETA, YAW_P, YAW_R, YAW_RUDDER = 0.25, 0.022, -1.0, 0.1
CENTRE_M: Final = (-0.15, -0.05)
"""Of lift, from the centre of gravity: forward and down."""
THRUST_N: Final = MASS_KG * GRAVITY_MPS2 / 0.7
"""Full thrust: it stands on its propeller at throttle 0.7."""
DRAG_OF_LIFT: Final = 1.0 / (math.pi * OSWALD * SPAN_M * SPAN_M / AREA_M2)
SERVO_PER_S: Final = 60.0 / 0.14 / 45.0
"""Greatest rate of a surface: 60 degrees in 0.14 s, of 45 to each side."""
MAX_BEYOND_RAD: Final = 0.8
"""Angle beyond the stall from which it is a flat plate alone."""
ROLLING_PER_S: Final = 0.3
"""Rate at which wheels slow it down."""
CREEPING_MPS: Final = 0.5
"""Speed below which it is held when its motor stands, as on a brake, tied down: no wind moves it."""
ROTATES_MPS: Final = 5.0
"""Ground speed below which its nose stays down."""


class FixedWing(RigidBody):
    """The aeroplane of ArduPilot's simulator."""

    mass_kg = MASS_KG
    inertia_kgm2 = (1.0, 1.0, 1.0)
    _aileron: float = 0.0
    _elevator: float = 0.0
    _throttle: float = 0.0
    _rudder: float = 0.0

    def throttle(self) -> float:
        """Return the throttle, 0 to 1."""
        return self._throttle

    def act(self, outputs_us: Sequence[int]) -> None:
        """Move surfaces as fast as their servos do; the throttle follows at once."""
        self._aileron = _moved(self._aileron, outputs_us[0], self.step_s)
        self._elevator = _moved(self._elevator, outputs_us[1], self.step_s)
        self._throttle = within((outputs_us[2] - 1000) / 1000.0, 0.0, 1.0)
        self._rudder = _moved(self._rudder, outputs_us[3], self.step_s)

    def forces(self, air_mps: Vector) -> tuple[Vector, Vector]:
        """Return the sum of thrust and aerodynamic force, and its moment."""
        u, v, w = air_mps
        thrust_n = self._throttle * THRUST_N
        speed_mps = math.sqrt(u * u + v * v + w * w)
        if speed_mps < 1e-3:
            return (thrust_n, 0.0, 0.0), (0.0, 0.0, 0.0)
        alpha, beta = math.atan2(w, u), math.asin(v / speed_mps)
        pressure_n = 0.5 * self.density * speed_mps * speed_mps * AREA_M2
        lift, drag = coefficients(alpha)
        cos, sin = math.cos(alpha), math.sin(alpha)
        x = pressure_n * (lift * sin - drag * cos)
        y = pressure_n * (SIDE_BETA * beta + SIDE_RUDDER * self._rudder)
        z = -pressure_n * (lift * cos + drag * sin)
        p, q, r = (0.5 * rate / speed_mps for rate in self.rates_rps)
        roll = ROLL_BETA * beta + SPAN_M * (ROLL_P * p + ROLL_R * r)
        roll += ROLL_AILERON * self._aileron + ROLL_RUDDER * self._rudder
        pitch = PITCH_0 + PITCH_ALPHA * alpha + CHORD_M * PITCH_Q * q + PITCH_ELEVATOR * self._elevator
        yaw = YAW_BETA * beta + SPAN_M * (YAW_P * p + YAW_R * r) + YAW_RUDDER * self._rudder
        ahead_m, below_m = CENTRE_M
        moment = (
            pressure_n * SPAN_M * roll - below_m * y,
            pressure_n * CHORD_M * pitch - ahead_m * z + below_m * x,
            pressure_n * SPAN_M * yaw + ahead_m * y,
        )
        return (x + thrust_n, y, z), moment

    def touch(self) -> None:
        """Roll ahead on its wheels; only its nose may rise, once it is fast."""
        (north, east, down), pitch_rad, nose_rad = self.velocity_mps, pitch_of(self.attitude), yaw_of(self.attitude)
        cos, sin = math.cos(nose_rad), math.sin(nose_rad)
        forward, right = max(north * cos + east * sin, 0.0), east * cos - north * sin
        stays_up = pitch_rad >= 0.0 and forward >= ROTATES_MPS
        pitching_rps = self.rates_rps[1] if stays_up else -pitch_rad / GROUND_S
        self.rates_rps = (-bank_of(self.attitude) / GROUND_S, pitching_rps, 0.0)
        if self._throttle == 0.0 and math.hypot(forward, right) < CREEPING_MPS:
            self.velocity_mps = 0.0, 0.0, 0.0
            return
        forward *= 1.0 - ROLLING_PER_S * self.step_s
        right = gripped(right, self.step_s)
        self.velocity_mps = forward * cos - right * sin, forward * sin + right * cos, down


class Trim(NamedTuple):
    """Level flight at an airspeed, and what it can do from there."""

    throttle: float
    """0 to 1."""
    climb_mps: float
    """At full throttle and the same airspeed."""
    sink_mps: float
    """Without thrust."""
    roll_rps: float
    """Steady rate for full aileron."""
    pitch_rps: float
    """Steady rate for full elevator, against its damping alone."""


def trim_of(airspeed_mps: float) -> Trim:
    """Return the trim in the air of the sea's level; climbs and sinks by the power that level flight doesn't need."""
    pressure_n = 0.5 * air_density_kgm3(0.0) * airspeed_mps * airspeed_mps * AREA_M2
    weight_n = MASS_KG * GRAVITY_MPS2
    lift = weight_n / pressure_n
    drag_n = pressure_n * (PARASITIC_DRAG + DRAG_OF_LIFT * lift * lift)
    return Trim(
        drag_n / THRUST_N,
        airspeed_mps * (THRUST_N - drag_n) / weight_n,
        airspeed_mps * drag_n / weight_n,
        2.0 * airspeed_mps * ROLL_AILERON / -(SPAN_M * ROLL_P),
        2.0 * airspeed_mps * PITCH_ELEVATOR / -(CHORD_M * PITCH_Q),
    )


def coefficients(alpha_rad: float) -> tuple[float, float]:
    """Return those of lift and drag at an angle of attack, rad: linear and induced up to the stall, then a plate's."""
    alpha = within(alpha_rad, -STALL_RAD - MAX_BEYOND_RAD, STALL_RAD + MAX_BEYOND_RAD)
    above, below = math.exp(-BLENDING * (alpha - STALL_RAD)), math.exp(BLENDING * (alpha + STALL_RAD))
    stalled = (1.0 + above + below) / ((1.0 + above) * (1.0 + below))
    linear, sin = LIFT_0 + LIFT_ALPHA * alpha, math.sin(alpha_rad)
    lift = (1.0 - stalled) * linear + stalled * math.copysign(2.0 * sin * sin, sin) * math.cos(alpha_rad)
    drag = (1.0 - stalled) * DRAG_OF_LIFT * linear * linear + stalled * 2.0 * abs(sin) ** 3
    return lift, PARASITIC_DRAG + drag


def _moved(surface: float, pulse_us: int, step_s: float) -> float:
    """Return where a surface is after a step, -1 to 1."""
    wanted = within((pulse_us - 1500) / 500.0, -1.0, 1.0) if pulse_us else 0.0
    return surface + within(wanted - surface, -SERVO_PER_S * step_s, SERVO_PER_S * step_s)
