"""Which vehicles are emulated in the place of real ones."""

from __future__ import annotations

from formation_scenario import Scenario, load_scenario
from sim_vehicles.config import stand_ins
from tests.flights.conftest import scenario


def of_families(*autopilots: str) -> Scenario:
    vehicles = [{"id": number, "role": "follower"} for number in range(1, len(autopilots) + 1)]
    vehicles[0]["role"] = "leader"
    planned = load_scenario(scenario(vehicles=vehicles))
    each = zip(planned.vehicles, autopilots, strict=True)
    return planned.model_copy(
        update={"vehicles": tuple(one.model_copy(update={"autopilot": family}) for one, family in each)}
    )


def test_it_is_said_which_real_vehicles_are_emulated() -> None:
    assert stand_ins(of_families("emulator", "emulator", "emulator")) == ""
    assert stand_ins(of_families("emulator", "arduplane", "emulator")) == "vehicle 2 (arduplane) is emulated"
    reported = "vehicle 1 (arduplane), vehicle 3 (arduplane) are emulated"
    assert stand_ins(of_families("arduplane", "emulator", "arduplane")) == reported
