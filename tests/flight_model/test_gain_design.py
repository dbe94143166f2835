"""Gains by design, of the formation law and of the consensus protocol, against their closed loops."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flight_model import energy
from flight_model.frequency_response import (
    FREQUENCIES,
    airframe_responses,
    delay_response,
    linearised,
    mismatched,
    stable_delay_s,
    tau_responses,
)
from flight_model.gain_design import (
    BANDWIDTHS,
    DELAY_MARGIN_S,
    MISMATCH_PEAK,
    PAIR,
    PEAK,
    STEPS,
    Axis,
    DelayAndNoise,
    consensus_gains,
    design,
    judged_channels,
)
from formation_scenario import load_scenario
from formation_scenario.gains import figures
from formation_scenario.vehicles import EnergyAirframe
from gcs_formation.control.fuzzy_pid import ChannelConstants, Pid, PidGains

WEIGHTS = {"k_x": 1.0, "k_psi": 0.1, "k_y": 0.05, "k_z": 1.0}
QUIET = DelayAndNoise(0.1, 0.1, 0.0, 0.0, 0.0)
NOISY = DelayAndNoise(0.1, 0.1, 0.02, 0.03, 0.002)
AIRCRAFT = EnergyAirframe().parameters()
PATH = {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}


def answer_to_a_sine(radps, amplitude_mps=0.02):
    """Return the complex amplitude of the airspeed for a unit sine of the setpoint, from a flight."""
    aircraft, flown = energy.Aircraft(100.0, 0.0, 22.0, 0.0), []
    energy.trim(aircraft, AIRCRAFT)
    cycles = round(round(90.0 * radps / (2 * math.pi)) * 2 * math.pi / radps / energy.ENERGY_S) * energy.CYCLES
    for cycle in range(cycles):
        now_s = cycle // energy.CYCLES * energy.ENERGY_S
        commanded = energy.Commanded(22.0 + amplitude_mps * math.sin(radps * now_s), math.inf, 0.0, 1.0, 100.0)
        if cycle % energy.CYCLES == 0:
            energy.control(aircraft, commanded, AIRCRAFT)
            flown.append((now_s, aircraft.speed_mps - 22.0))
        energy.cycle(aircraft, commanded, AIRCRAFT)
    at_s, speeds = np.array(flown[len(flown) // 2 :]).T
    columns = np.column_stack((np.sin(radps * at_s), np.cos(radps * at_s), np.ones_like(at_s)))
    (sine, cosine, _), *_ = np.linalg.lstsq(columns, speeds, rcond=None)
    return complex(sine, cosine) / amplitude_mps


def test_an_aircrafts_response_is_what_a_small_sine_comes_back_as():
    radps = 1.0
    response = airframe_responses(np.array([radps]), AIRCRAFT, 22.0).speed[0]
    undelayed = response * np.exp(1j * radps * AIRCRAFT.dead_time_s)
    held = np.exp(1j * radps * energy.ENERGY_S / 2) * np.sinc(radps * energy.ENERGY_S / (2 * math.pi))
    assert undelayed / held == pytest.approx(answer_to_a_sine(radps), abs=0.03)


def test_faster_swings_of_speed_than_half_a_radian_a_second_cost_height():
    (matrix, inputs), index = linearised(AIRCRAFT, 22.0), energy.QUANTITIES.index("height_m")
    by_speed = [
        np.linalg.solve(np.exp(1j * radps * energy.ENERGY_S) * np.eye(len(matrix)) - matrix, inputs[:, 0])
        for radps in (0.05, 0.8)
    ]
    slow_m, fast_m = (abs(answer[index]) for answer in by_speed)
    assert slow_m < 0.3
    assert fast_m > 1.5


def test_figures_of_a_first_order_loop_are_the_closed_forms():
    """kp/s has its crossover at kp, and a phase margin of 90 degrees minus the delay's."""
    plants = [tau_responses(1e-4, 1e-4, (1e-4, 1e-4))]
    gains = {"speed": (0.5, 0.0, 0.0), "heading": (0.5, 0.0, 0.0), "height": (0.0, 0.5, 0.0)}
    found = judged_channels(gains, plants, 20.0, {"k_x": 1.0, "k_psi": 0.0, "k_y": 0.05, "k_z": 1.0}, NOISY)
    for name in ("speed", "heading", "height"):
        assert found[name].bandwidth_radps == pytest.approx(0.5)
        assert found[name].delay_margin_s == pytest.approx(math.pi / 2 / 0.5 - 0.1, rel=0.03)
    assert found["speed"].step_sigma == pytest.approx(0.5 * math.sqrt(2) * math.sqrt(2) * math.hypot(0.02, 0.003))


def test_noise_moves_setpoints_as_it_moves_the_laws_controllers():
    """White noise of 0.02 m in position and 0.03 m/s in velocity, each of the difference of two vehicles."""
    plants, weights, gains = (
        [tau_responses(4.0, 1.5, (1.0, 3.0))],
        {"k_x": 1.0, "k_psi": 0.0, "k_y": 0.05, "k_z": 1.0},
        (0.6, 0.05, 1.2),
    )
    known = DelayAndNoise(0.1, 0.0, 0.02, 0.03, 0.0)
    found = judged_channels(dict.fromkeys(("speed", "heading", "height"), gains), plants, 22.0, weights, known)
    pid = Pid(ChannelConstants(PidGains(*gains, 0.3), 1.0, 1.0, math.inf), None)
    rng, setpoints = np.random.default_rng(1), []
    for error, slope in np.sqrt(2.0) * rng.normal(0.0, (0.02, 0.03), (20000, 2)):
        pid.filter_rate(slope, 0.1)
        pid.schedule(error, 1.0)
        setpoints.append(pid.output(error))
        pid.integrate(error, 0.0, 0.1)
    assert found["speed"].step_sigma == pytest.approx(np.std(np.diff(setpoints)), rel=0.03)


def test_a_loop_beyond_its_delay_margin_is_unstable():
    plants = [tau_responses(1e-4, 1e-4, (1e-4, 1e-4))]
    gains = dict.fromkeys(("speed", "heading"), (0.5, 0.0, 0.0)) | {"height": (0.0, 0.5, 0.0)}
    for delay_s, stable in ((3.0, True), (3.3, False)):
        late = DelayAndNoise(0.1, delay_s, 0.0, 0.0, 0.0)
        found = judged_channels(gains, plants, 20.0, {"k_x": 1.0, "k_psi": 0.0, "k_y": 0.05, "k_z": 1.0}, late)
        assert math.isfinite(found["speed"].peak) == stable


@pytest.mark.parametrize(
    "response", [airframe_responses(FREQUENCIES, AIRCRAFT, 22.0), tau_responses(4.0, 1.5, (1.0, 3.0))]
)
@pytest.mark.parametrize("delay_s", [0.1, 0.7])
def test_a_design_holds_its_bounds(response, delay_s):
    channels, _ = design([response], 22.0, WEIGHTS, DelayAndNoise(0.1, delay_s, 0.02, 0.03, 0.002))
    for channel, steps in zip(channels.values(), STEPS, strict=True):
        assert channel.peak <= PEAK
        assert channel.mismatch_peak <= MISMATCH_PEAK
        assert channel.delay_margin_s >= DELAY_MARGIN_S
        assert channel.step_sigma <= steps


@pytest.mark.parametrize("delay_s", [0.1, 0.7])
def test_the_winds_observer_leaves_85_percent_of_the_airspeeds_delay_margin(delay_s):
    """An aircraft whose gain is 4 at 2 rad/s seems to fly in wind, and is commanded to compensate for it."""
    response = airframe_responses(FREQUENCIES, AIRCRAFT, 22.0)
    channels, (_, observer_radps, _) = design([response], 22.0, WEIGHTS, NOISY._replace(delay_s=delay_s))
    channel, s = channels["speed"], 1j * FREQUENCIES
    plant = response.speed * np.exp(
        -s * (delay_s + 0.6)
    )  # over 300 ms in each direction, which the design doesn't know
    alone = (channel.kp + channel.ki / s + channel.kd * s / (0.3 * s + 1)) / s * plant

    def margin_s(radps):
        """Return the smallest further delay at which the loop comes to -1."""
        loop = alone + radps / (s + radps) * plant
        (at,) = np.nonzero((np.abs(loop[:-1]) >= 1) != (np.abs(loop[1:]) >= 1))
        return np.min(np.mod(np.angle(-loop[at]), 2 * np.pi) / FREQUENCIES[at])

    assert margin_s(observer_radps) >= 0.85 * margin_s(0.0)
    assert margin_s(1.2 * observer_radps) < 0.85 * margin_s(0.0)


def test_a_longer_delay_and_more_noise_make_slower_loops():
    plants = [airframe_responses(FREQUENCIES, AIRCRAFT, 22.0)]
    near, _ = design(plants, 22.0, WEIGHTS, QUIET)
    far, _ = design(plants, 22.0, WEIGHTS, DelayAndNoise(0.1, 1.5, 0.0, 0.0, 0.0))
    loud, _ = design(plants, 22.0, WEIGHTS, DelayAndNoise(0.1, 0.1, 0.2, 0.3, 0.02))
    for name in ("speed", "heading"):
        assert far[name].bandwidth_radps < near[name].bandwidth_radps
        assert loud[name].bandwidth_radps < near[name].bandwidth_radps


@pytest.mark.parametrize("law", [{"type": "pid"}, {"type": "consensus"}])
def test_gains_are_for_the_dead_time_as_for_a_link_that_is_as_much_slower(law):
    def of(model, **keys):
        vehicles = {"count": 2, "model": {"airframe": {}, **model}}
        designed = load_scenario({"vehicles": vehicles, "path": PATH, "law": law | {"gains": "auto"} | keys}).law
        return designed.speed, designed.heading, designed.height, designed.consensus.k1

    assert of({"dead_time_s": 0.3}) == of({}, design_delay_ms=150) != of({})


def scenario(**law):
    return load_scenario({"vehicles": {"count": 2, "model": "arduplane"}, "path": PATH} | ({"law": law} if law else {}))


def test_gains_are_by_design_where_the_model_is_an_aircrafts_and_explicit_ones_win():
    found = scenario()
    assert found.law.gains == "auto"
    assert scenario(speed={"kp": 0.1}).law.speed.kp == 0.1
    assert scenario(speed={"kp": 0.1}).law.height == found.law.height
    assert scenario(gains="clean").law.speed.kp == 3.0
    assert load_scenario(found) == found
    paper = load_scenario({"vehicles": {"count": 2}, "path": PATH})
    assert paper.law.gains == "clean"


def test_gains_for_equation_7_are_seen_to_be_unstable_around_an_aircraft():
    assert math.isinf(figures(scenario(gains="clean"))["speed"].peak)
    assert math.isfinite(figures(scenario())["speed"].mismatch_peak)


SPEED_MPS, TAU_V_S, TAU_PSI_S = 22.0, 2.0, 3.0
SENSOR_M, SAMPLING_S, NEAR = 0.02, 0.1, (0.1, 0.0)
STAR_OF_4 = (0.0, 1.0, 1.0, 4.0)


def axes(responses):
    return Axis.along(TAU_V_S, responses.speed), Axis.across(TAU_PSI_S, responses.heading, SPEED_MPS)


AXES = axes(airframe_responses(FREQUENCIES, EnergyAirframe().parameters(), SPEED_MPS))
TAUS = axes(tau_responses(TAU_V_S, TAU_PSI_S, (1.0, 3.0)))


def loop(gains, axis, mode):
    k1, k2, k3 = gains
    s = 1j * FREQUENCIES
    return axis.tau_s * (mode * (k1 / s + k2) + k3 - 1.0 / axis.tau_s) * axis.response * delay_response(SAMPLING_S)


@pytest.mark.parametrize("links_s", [0.0, 0.6])
def test_every_mode_around_the_aircraft_has_the_delay_margin_and_the_peak_that_a_pids_loops_have(links_s):
    gains = consensus_gains([AXES], STAR_OF_4, SENSOR_M, SAMPLING_S, links_s)
    for mode in (0.0, 1.0, 4.0):
        for axis in AXES:
            closed = loop(gains, axis, mode)
            assert stable_delay_s(closed, 1 if mode else 0) >= DELAY_MARGIN_S + links_s
            assert np.max(1.0 / np.abs(1.0 + closed)) <= PEAK


def test_the_papers_gains_are_unstable_around_an_aircraft_and_stable_around_its_model():
    paper = 0.1, 0.6, 0.25
    assert stable_delay_s(loop(paper, AXES[0], 4.0), 1) == 0.0
    assert stable_delay_s(loop(paper, TAUS[0], 4.0), 1) > 0.5


def test_the_fastest_mode_is_as_fast_on_every_graph():
    (few, _, damping), (many, _, same) = (
        consensus_gains([AXES], (0.0, 1.0, largest), SENSOR_M, *NEAR) for largest in (4.0, 10.0)
    )
    assert 4.0 * few == pytest.approx(10.0 * many)
    assert damping == same == 1.0 / TAU_V_S


def test_noise_of_positions_moves_setpoints_by_no_more_than_a_pids():
    noise_m = 0.2
    k1, _, _ = consensus_gains([AXES], STAR_OF_4, noise_m, *NEAR)
    assert TAU_V_S * 4.0 * k1 * PAIR * noise_m <= STEPS[0]
    assert TAU_PSI_S * 4.0 * k1 * PAIR * noise_m <= STEPS[1] * SPEED_MPS
    assert 4.0 * k1 < 4.0 * consensus_gains([AXES], STAR_OF_4, SENSOR_M, *NEAR)[0]


def test_links_over_which_nothing_holds_leave_the_slowest_that_is_tried():
    k1, _, _ = consensus_gains([AXES], STAR_OF_4, SENSOR_M, SAMPLING_S, math.inf)
    assert 4.0 * k1 == pytest.approx(BANDWIDTHS[-1])


def test_a_loop_of_gain_1_at_the_highest_frequency_counts_as_unstable():
    assert stable_delay_s(np.full(FREQUENCIES.size, 1.01 + 0j), 0) == 0.0
    assert stable_delay_s(np.full(FREQUENCIES.size, 0.99 + 0j), 0) == math.inf


def test_a_channel_that_a_limit_holds_has_loops_without_a_response_and_without_a_warning() -> None:
    loops = list(mismatched(np.ones(FREQUENCIES.size, complex), np.zeros(FREQUENCIES.size, complex)))
    assert len(loops) == 4
    assert np.abs(loops).max() < 1e-200
