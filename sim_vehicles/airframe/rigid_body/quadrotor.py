"""A quadrotor in plus configuration, motors right, left, front and back on outputs 1 to 4.

Mass, arms, thrust curve and drag are those of the quadrotor in ArduPilot's own simulator (libraries/SITL/SIM_Frame.h,
SIM_Motor.cpp). A rotor's thrust is that of a disc that air leaves at the speed that its command sets (momentum theory);
drag of the rotors grows with the root of their thrust, that of the frame with the square of the velocity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from flight_model.autopilot_model import within
from flight_model.energy import GRAVITY_MPS2
from flight_model.slot import slot_axis
from sim_vehicles.airframe.rigid_body.motion import GROUND_S, RigidBody, Vector, bank_of, gripped, pitch_of

MASS_KG: Final = 3.0
ARM_M: Final = 0.35
IDLE_US, FULL_US = 1150.0, 1950.0
"""Pulses from which a motor turns, and at which it gives all."""
EXPO: Final = 0.65
"""Share of its thrust curve that is quadratic."""
HOVER_POWER_W: Final = 12.09 * 29.3
HOVER_THRUST_SHARE: Final = 0.39
"""Of full thrust in hover, at the density of 593 m above sea level."""
REFERENCE_DENSITY: Final = 1.157
OUTFLOW_MPS: Final = 2.0 * HOVER_POWER_W / (MASS_KG * GRAVITY_MPS2) / math.sqrt(HOVER_THRUST_SHARE)
"""Speed of the air that leaves a rotor at full power."""
DISC_M2: Final = MASS_KG * GRAVITY_MPS2 / (0.5 * REFERENCE_DENSITY * HOVER_THRUST_SHARE * OUTFLOW_MPS**2) / 4.0
"""Effective area of each rotor."""
ROTORS_M2: Final = 0.385
"""True area of all."""
ROTOR_DRAG: Final = 0.2
TERMINAL_MPS: Final = 15.08
"""Horizontal speed at which it tilts by 45 degrees."""
TORQUE_PER_N: Final = 0.05 * ARM_M
"""Torque of a rotor at full command for each newton of its thrust, N m."""
RING_KGM2: Final = MASS_KG * (ARM_M / 2.0) ** 2
"""Of a ring about its axis; half the quadrotor's mass is on one, whose inertia about a diameter is half as large."""
TURNING_PER_S: Final = math.radians(400.0) / 120.0
"""Rate at which air slows its turning."""


def _frame_drag_m2() -> float:
    """Return drag area times coefficient, of what the rotors' drag leaves at 45 degrees of tilt."""
    weight_n, cos = MASS_KG * GRAVITY_MPS2, math.sqrt(0.5)
    rotors_n = ROTOR_DRAG * TERMINAL_MPS * cos * cos * math.sqrt(weight_n / cos * REFERENCE_DENSITY * ROTORS_M2)
    return (weight_n - rotors_n) / (0.5 * REFERENCE_DENSITY * TERMINAL_MPS**2)


FRAME_DRAG_M2: Final = _frame_drag_m2()


class Quadrotor(RigidBody):
    """The quadrotor of ArduPilot's simulator."""

    mass_kg = MASS_KG
    inertia_kgm2 = (RING_KGM2 / 4.0, RING_KGM2 / 4.0, RING_KGM2 / 2.0)
    _commands: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def throttle(self) -> float:
        """Return the mean of the motors' commands, 0 to 1."""
        return sum(self._commands) / 4.0

    def act(self, outputs_us: Sequence[int]) -> None:
        """Turn the motors as commanded, at once."""
        right, left, front, back = (within((each - IDLE_US) / (FULL_US - IDLE_US), 0.0, 1.0) for each in outputs_us[:4])
        self._commands = right, left, front, back

    def forces(self, air_mps: Vector) -> tuple[Vector, Vector]:
        """Return thrust and drag, and the rotors' moments."""
        u, v, w = air_mps
        thrusts = [self._thrust_n(each, max(-w, 0.0)) for each in self._commands]
        right, left, front, back = thrusts
        roots = sum([math.sqrt(each) for each in thrusts])
        rotors = ROTOR_DRAG * math.sqrt(self.density * ROTORS_M2 / 4.0) * roots
        frame = 0.5 * self.density * FRAME_DRAG_M2
        force = (
            -u * (rotors + frame * abs(u)),
            -v * (rotors + frame * abs(v)),
            -sum(thrusts) - w * (rotors + frame * abs(w)),
        )
        torques = [TORQUE_PER_N * each * command for each, command in zip(thrusts, self._commands, strict=True)]
        p, q, r = self.rates_rps
        ix, iy, iz = self.inertia_kgm2
        moment = (
            ARM_M * (left - right) - TURNING_PER_S * ix * p,
            ARM_M * (front - back) - TURNING_PER_S * iy * q,
            torques[0] + torques[1] - torques[2] - torques[3] - TURNING_PER_S * iz * r,
        )
        return force, moment

    def touch(self) -> None:
        """Stand level where it is, unless it rises."""
        self.rates_rps = (-bank_of(self.attitude) / GROUND_S, -pitch_of(self.attitude) / GROUND_S, 0.0)
        north, east, down = self.velocity_mps
        self.velocity_mps = gripped(north, self.step_s), gripped(east, self.step_s), down

    def axis_rad(self, nose_rad: float, north_mps: float, east_mps: float) -> float:
        """Return the axis of the slots behind it, as the law defines it."""
        return slot_axis(nose_rad, north_mps, east_mps)

    def settle(self) -> None:
        """As every body's; a multirotor's airspeed in the record is its ground speed."""
        super().settle()
        self.state.airspeed_mps = math.hypot(self.velocity_mps[0], self.velocity_mps[1])

    def _thrust_n(self, command: float, inflow_mps: float) -> float:
        outflow_mps2 = OUTFLOW_MPS**2 * ((1.0 - EXPO) * command + EXPO * command * command)
        return max(0.5 * self.density * DISC_M2 * (outflow_mps2 - inflow_mps * inflow_mps), 0.0)
