"""The mathematics without a scenario is that of flights, and needs no file."""

import importlib
import math
import pkgutil
import subprocess
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import gcs_formation
from formation_scenario import load_scenario
from gcs_formation.control.laws import nominal_gains
from gcs_formation.library import (
    FlightState,
    FuzzyGainScheduler,
    GainRange,
    LawGains,
    Mixer,
    PidGains,
    VehicleModel,
    consensus_delay_margin,
    delay_margins,
    delays,
    design_gains,
    fly,
    loop_delay_s,
    mismatch_margins,
    project,
)
from gcs_formation.stability import law_margins

PLAIN = {
    "vehicles": {"count": 2},
    "start": {"in_air": True},
    "duration_s": 3,
    "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
}


def gains_of(scenario) -> LawGains:
    return LawGains(Mixer(**scenario.law.mixer.model_dump()), *nominal_gains(scenario))


@pytest.mark.parametrize("law", ["pid", "fuzzy_pid"])
@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading"])
def test_margins_are_those_of_a_scenario_s_law(law, frame):
    slots = {"shape": "custom", "slots_m": {2: [-50, 0, 0]}, "frame": frame}
    scenario = load_scenario({**PLAIN, "law": {"type": law, "gains": "clean"}, "formation": slots})
    gain_range = GainRange() if law == "fuzzy_pid" else GainRange(1.0, 0.0)
    told: dict[str, Any] = {"ahead_m": 50.0 if frame == "follower_heading" else 0.0, "gain_range": gain_range}
    found = [delay_margins(gains_of(scenario), VehicleModel(), worst=worst, **told) for worst in (False, True)]
    expected = law_margins(scenario)
    assert found == [pytest.approx(expected.small_signal), pytest.approx(expected.worst)]


def test_a_first_order_lag_under_proportional_control_has_the_margin_of_the_textbook():
    """k/(s (tau s + 1)): crossover w, margin (pi/2 - atan(tau w))/w."""
    gains = LawGains(Mixer(0.0, 1.0, 0.0, 0.1, 1.0), *(PidGains(0.5, 0.0, 0.0, 0.0),) * 3)
    tau, k = 4.0, 0.5
    w = math.sqrt((math.sqrt(1 + 4 * tau**2 * k**2) - 1) / (2 * tau**2))
    found = delay_margins(gains, VehicleModel(tau_v_s=tau))
    assert found["x"] == pytest.approx((math.pi / 2 - math.atan(tau * w)) / w, rel=1e-9)


@pytest.mark.parametrize("model", [VehicleModel(), VehicleModel(tau_v_s=2.0, tau_psi_s=3.0)])
def test_a_design_is_that_of_gains_auto(model):
    keys = {**PLAIN, "vehicles": {"count": 2, "model": model.model_dump()}, "law": {"gains": "auto"}}
    keys["links"] = {"default": {"delay_ms": 300}}
    scenario = load_scenario(keys)
    found = design_gains(model, delay_s=0.3)
    assert (found.speed, found.heading, found.height) == nominal_gains(scenario)
    assert found.mixer == gains_of(scenario).mixer
    assert load_scenario({**keys, "law": {}}, [f"{k}={v}" for k, v in found.scenario_keys().items()]).law.speed.kp == (
        scenario.law.speed.kp
    )
    assert all(margin_s > loop_delay_s(0.3, 0.3, 10.0, 10.0) for margin_s in delay_margins(found, model).values())


def test_with_prediction_a_loop_bears_a_delay_that_it_would_not_bear_without():
    gains, model = design_gains(VehicleModel()), VehicleModel()
    margin_s = delay_margins(gains, model)["x"]
    found = mismatch_margins(gains, model, 2.0 * margin_s)
    assert set(found) == set("xyz")
    assert found["x"].shorter_s < 0.0 < found["x"].longer_s


def test_a_vehicle_flies_by_equation_7():
    """A step of airspeed within the limit of acceleration is a first-order lag."""
    model = VehicleModel(tau_v_s=4.0, accel_max_mps2=10.0)
    flown = fly(model, [[24.0, 0.0, 100.0]] * 80, 0.1, start=FlightState(0, 0, 100.0, 0, 20.0, 0.0, 0, 0))
    assert flown.airspeed_mps == pytest.approx(24.0 - 4.0 * np.exp(-flown.time_s / 4.0), abs=1e-9)
    travelled = 24.0 * flown.time_s - 16.0 * (1.0 - np.exp(-flown.time_s / 4.0))
    assert flown.north_m == pytest.approx(travelled, abs=1e-6)
    assert np.allclose((flown.east_m, flown.climb_mps), 0.0)
    drifted = fly(model, [[22.0, math.pi / 2, 100.0]] * 10, 0.5, wind_mps=(2.0, -1.0))
    assert (drifted.north_m[-1], drifted.east_m[-1]) == pytest.approx((10.0, 105.0))
    assert fly(model, [[99.0, 0.0, 0.0]], 1.0).airspeed_mps.tolist() == [model.speed_max_mps] * 2


def test_a_projection_is_the_flight_through_the_setpoints_in_flight():
    model = VehicleModel()
    setpoints = [[22.0 + 0.5 * i, 0.1 * i, 100.0 + i] for i in range(8)]
    flown = fly(model, setpoints, 0.25, wind_mps=(3.0, 1.0))
    begin = FlightState(0, 0, 100.0, 0, 22.0, 0.0, 3.0, 1.0)
    sent = [[5.0 + 0.25 * i, *each] for i, each in enumerate(setpoints)]
    found = project(begin, 5.0, sent, 7.0, model)
    last = [column[-1] for column in flown[1:]]
    assert found.values()[:6] == pytest.approx(last, abs=1e-6)
    assert begin.north_m == 0.0, "not changed"
    straight = project(begin, 1.0, sent, 5.0, model)
    assert (straight.north_m, straight.east_m) == pytest.approx((100.0, 4.0)), "before the first acts: straight on"


def test_delays_are_estimated_from_answers():
    """120 ms up, 80 ms down, a clock 5 s ahead that gains 20 ppm: half of the round trip, and its middle."""
    sent = np.arange(0.0, 60.0, 0.25)
    there = 5.0 + (1.0 + 2e-5) * (sent + 0.12)
    found = delays(sent, there, sent + 0.2)
    assert found.one_way_s[-1] == pytest.approx(0.1, abs=1e-9)
    assert found.round_trip_s == pytest.approx(np.full(sent.size, 0.2))
    assert found.drift[-1] == pytest.approx(2e-5, rel=0.05)
    assert found.offset_s[-1] == pytest.approx(5.02 + 2e-5 * sent[-1], abs=1e-4)
    assert found.asymmetry_s[-1] == 0.0
    assert [each.shape for each in delays([], [], [])] == [(0,)] * 6
    late = np.where(sent > 30.0, 0.1, 0.0)  # the way up becomes 0.1 s longer
    assert delays(sent, there + late, sent + 0.2 + late).asymmetry_s.max() == pytest.approx(0.05, abs=1e-3)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: fly(VehicleModel(), [1.0, 2.0, 3.0], 0.1), r"setpoints: found shape \(3,\); allowed: \(n, 3\)"),
        (lambda: fly(VehicleModel(), [[1.0, 2.0, math.nan]], 0.1), "aren't finite"),
        (lambda: fly(VehicleModel(), [[1.0, 2.0, 3.0]], 0.0), "dt_s: found 0.0; allowed: a number > 0"),
        (lambda: fly(VehicleModel(hovers=True, speed_min_mps=0), [[1, 2, 3]], 1), "model: found a vehicle that hovers"),
        (lambda: project(FlightState(*[0.0] * 8), 2.0, [[0, 1, 2, 3]], 1.0, VehicleModel()), "before measured_s"),
        (lambda: project(FlightState(*[0.0] * 8), 0.0, [[1, 1, 2, 3], [0, 1, 2, 3]], 1.0, VehicleModel()), "that fall"),
        (lambda: delays([1.0], [1.0], [0.5]), "an answer before its request"),
        (lambda: delays([1.0], [1.0, 2.0], [0.5]), "found shapes"),
        (lambda: design_gains(VehicleModel(), delay_s=-0.1), "delay_s: found -0.1; allowed: a number >= 0"),
        (lambda: design_gains(VehicleModel(), law_rate_hz=0), "law_rate_hz: found 0; allowed: a number > 0"),
        (lambda: delay_margins(design_gains(VehicleModel()), VehicleModel(), speed_mps=0), "speed_mps: found 0"),
        (lambda: mismatch_margins(design_gains(VehicleModel()), VehicleModel(), -1.0), "predicted_s: found -1.0"),
    ],
)
def test_what_is_not_allowed_is_said(call, said):
    with pytest.raises(ValueError, match=said):
        call()


def test_what_other_modules_have_is_here_too():
    assert consensus_delay_margin([[0, 1], [1, 0]], 0.1, 0.6) > 0.0
    assert FuzzyGainScheduler().infer([0.0, 1.0], 0.0).shape == (2, 3)


def test_a_margin_needs_no_scenario_s_file_and_no_flight():
    code = "import sys; import gcs_formation.library; print(*sorted(m for m in sys.modules if 'gcs_formation.a' in m))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == ""


def test_no_module_is_shadowed_by_a_name_of_its_package():
    shadowed = list[str]()
    for top in ("airlink", "flight_model", "formation_scenario", "sim_vehicles", "gcs_formation"):
        package = importlib.import_module(top)
        names = [
            each.name for each in pkgutil.walk_packages(package.__path__, f"{top}.") if "__main__" not in each.name
        ]
        modules = {name: importlib.import_module(name) for name in names}
        for name, module in modules.items():
            parent, _, last = name.rpartition(".")
            found = getattr(sys.modules[parent], last)
            if not isinstance(found, ModuleType) or found is not module:
                shadowed.append(name)
    assert shadowed == []
    assert not {name for name in gcs_formation.__all__ if isinstance(getattr(gcs_formation, name), ModuleType)}
