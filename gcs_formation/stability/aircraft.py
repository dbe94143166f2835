"""What an aircraft answers where that isn't equation (7): loops around it have delay margins of their own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from flight_model.arrays import Complex
from flight_model.energy import AirframeParameters
from flight_model.frequency_response import airframe_responses, lag_responses
from flight_model.gain_design import FREQUENCIES, stable_delay_s
from formation_scenario.vehicles import VehicleModel


@dataclass(frozen=True, eq=False, slots=True)
class AircraftResponse:
    """One setpoint's response of an aircraft in level flight, as a multiple of its model's by (7), at `FREQUENCIES`."""

    by_model: Complex

    def delay_margin_s(self, open_loop: Complex, integrators: int) -> float:
        """Return the delay margin, s, around the aircraft of a loop that has (7) in it; 0 if unstable without delay.

        Args:
            open_loop: L around (7) at `FREQUENCIES`, without delay.
            integrators: how many poles at 0 it has.
        """
        return stable_delay_s(open_loop * self.by_model, integrators)


Axes = tuple[AircraftResponse, AircraftResponse, AircraftResponse] | tuple[None, None, None]


def aircraft_responses(model: VehicleModel, speed_mps: float) -> Axes:
    """Return the responses of speed, heading and height at an airspeed, m/s; None of what flies as (7) says."""
    if model.airframe is None:
        return None, None, None
    airframe = AirframeParameters.of(model.airframe.parameters())
    return _responses(airframe, speed_mps, (model.tau_v_s, model.tau_psi_s), (model.tau_ha_s, model.tau_hb_s))


@cache
def _responses(
    airframe: AirframeParameters, speed_mps: float, lags_s: tuple[float, float], heights_s: tuple[float, float]
) -> tuple[AircraftResponse, AircraftResponse, AircraftResponse]:
    true, model = airframe_responses(FREQUENCIES, airframe, speed_mps), lag_responses(FREQUENCIES, *lags_s, heights_s)
    speed, heading, height = true.speed / model.speed, true.heading / model.heading, true.height / model.height
    return AircraftResponse(speed), AircraftResponse(heading), AircraftResponse(height)
