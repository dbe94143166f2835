"""A station flies by what it measures: the emulators' air, faults, links, clocks and true models aren't told to it."""

from __future__ import annotations

from typing import Any

import pytest

from airlink.clock import Instant, VirtualClock, after
from airlink.engine import MemoryNetwork
from formation_scenario import load_scenario
from gcs_formation.app.link_injection import impair
from gcs_formation.mission.gate import UNCHECKED
from gcs_formation.station import Station
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario
from tests.flights.in_memory import MemoryRecorder

KNOWN: list[dict[str, Any]] = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3}]
TRUE: list[dict[str, Any]] = [
    {"true_model": {"tau_v_s": 3.2, "tau_psi_s": 1.8}, "clock": {"offset_s": 7.5, "drift_ppm": 30}},
    {"true_model": {"tau_v_s": 4.9}, "true_navigation": {"source": "noisy", "position_sigma_m": 0.2}},
    {"clock": {"offset_s": 300.0, "drift_ppm": -40}},
]
UNKNOWN: dict[str, Any] = {
    "vehicles": [known | true for known, true in zip(KNOWN, TRUE, strict=True)],
    "wind": {"velocity_mps": [4.0, -3.0, 0.0]},
    "disturbances": [{"at_s": 0, "kind": "dryden", "wind_6m_mps": 5}],
    "faults": [{"at_s": 0, "vehicles": [2], "kind": "restart"}],
    "links": {"default": {"delay_ms": 80, "jitter_ms": 15, "loss": 0.02}},
}
"""What emulators and links are told beyond what a station of real vehicles can know."""


class Sent(MemoryRecorder):
    """Keeps the frames that went both ways."""

    def __init__(self) -> None:
        super().__init__()
        self.raws = list[bytes]()

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        self.raws += raws


def flown(station_keys: dict[str, Any], seconds: float, **keys: Any) -> tuple[Station, Sent]:
    """Fly emulators with everything that is unknown by a station with these keys."""
    planned, known = (load_scenario(scenario(**keys | more)) for more in (UNKNOWN, station_keys))
    recorder, clock = Sent(), VirtualClock()
    station, network = Station(known, recorder, caution=UNCHECKED), MemoryNetwork(clock)
    network.attach(Fleet(fleet_config(planned)))
    network.attach(impair(planned, station) or station)
    end = after(Instant(0), seconds)
    network.run(lambda: station.flight.ended or clock.now() >= end)
    return station, recorder


@pytest.mark.slow
def test_it_flies_the_same_bytes_without_what_it_cant_know() -> None:
    """Followers need longer than the run-in, so that a lap is flown, whose turns the wind widens."""
    start = {"in_air": True, "run_in_s": 5, "offset_m": [0, 150, 4]}
    (station, sent), (_, same) = (flown(keys, 25.0, start=start) for keys in (UNKNOWN, {"vehicles": KNOWN}))
    assert station.controller.guidance.rounds == 1
    assert sent.raws == same.raws


def test_an_order_is_judged_in_the_wind_that_is_measured() -> None:
    """At 16 m/s against 15.5 m/s nothing would be left over the ground; the station isn't told of that wind."""
    wind, orders = {"velocity_mps": [-15.5, 0.0, 0.0]}, [{"at_s": 2, "order": "speed 16"}]
    planned, recorder, clock = load_scenario(scenario(wind=wind)), MemoryRecorder(), VirtualClock()
    network = MemoryNetwork(clock)
    station = Station(load_scenario(scenario(orders=orders)), recorder, caution=UNCHECKED)
    network.attach(Fleet(fleet_config(planned)))
    network.attach(station)
    network.run(lambda: station.flight.mission_time_s(clock.now()) >= 3.0 or clock.now() > after(Instant(0), 60.0))
    (said,) = [event.text for event in recorder.events if event.kind == "order"]
    assert "m/s over the ground is left, at 16 m/s of airspeed in a wind of 15." in said
