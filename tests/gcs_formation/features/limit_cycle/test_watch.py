"""Who is named as swinging about its slot, and with which cause; vehicles are mere errors here."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from gcs_formation.features.limit_cycle.answer import Answer
from gcs_formation.features.limit_cycle.feature import FEATURE
from gcs_formation.features.limit_cycle.swings import Swings
from gcs_formation.features.limit_cycle.watch import LimitCycles
from tests.gcs_formation.event_log import EventLog

PERIOD_S, TICK_S, TAU_S = 8.0, 0.1, 1.5
RADPS = math.tau / PERIOD_S


class Swinging:
    """The second of two vehicles swings about its slot by 3 m, and answers headings late."""

    def __init__(self, late_s: float = 0.0, margin_used: float = 0.3) -> None:
        self.late_s, self.logged, self.now = late_s, EventLog(), Instant(0)
        self.seen = SimpleNamespace(state=SimpleNamespace(heading_rad=0.0), stamp=Instant(0))
        self.each = [SimpleNamespace(index=index, identity=VehicleId(1, 1 + index)) for index in range(2)]
        controller = SimpleNamespace(
            count=2,
            estimator=SimpleNamespace(filters=[SimpleNamespace(state=None), self.seen]),
            models=[SimpleNamespace(tau_psi_s=99.0), SimpleNamespace(tau_psi_s=TAU_S)],
        )
        findings = SimpleNamespace(margin_used=[math.nan, margin_used])
        cycle: Any = SimpleNamespace(each=self.each, controller=controller, findings=findings, log_event=self.logged)
        self.cycle, self.watch = cycle, LimitCycles(cycle)
        self.uplink_s, self.further_s = 0.25, 0.15

    def run(self, seconds: float, amplitude_m: float = 3.0, **given: Any) -> None:
        """Fly on. A first-order lag turns the phase of a heading by atan(w tau)."""
        for _ in range(round(seconds / TICK_S)):
            at_s = self.now * 1e-9
            error_m = amplitude_m * math.sin(RADPS * at_s)
            acts_s = at_s + self.uplink_s + self.further_s
            self.seen.stamp = after(self.now, -0.3)
            behind_rad = RADPS * self.late_s + math.atan(RADPS * TAU_S)
            self.seen.state.heading_rad = 0.2 * math.sin(RADPS * (at_s - 0.3) - behind_rad)
            asked_rad = 0.4 * math.sin(RADPS * acts_s)
            tick = {
                "now": self.now,
                "error_of": lambda index, error_m=error_m: (9.0, error_m if index else math.nan, 9.0),
                "yielding": [True, False],
                "replaced": [(True, True, True), (True, False, True)],
                "links": [SimpleNamespace(uplink_delay_s=self.uplink_s, further_delay_s=self.further_s)] * 2,
                "setpoints": [(0.0, 0.0, 0.0), (22.0, asked_rad, 100.0)],
            }
            self.cycle.tick, self.cycle.now = SimpleNamespace(**tick | given), self.now
            self.watch.run(self.cycle)
            self.now = after(self.now, TICK_S)


@pytest.mark.parametrize(
    ("late_s", "margin_used", "cause"),
    [
        (0.0, 0.3, "its model seems right, so gains are too high for it"),
        (0.09, math.nan, "its model seems right, so gains are too high for it"),
        (0.11, 0.79, "it answers headings 0.11 s later than its model says"),
        (0.5, 0.79, "it answers headings 0.50 s later than its model says"),
        (0.5, 0.81, "its loops use 81% of their delay margin, so its link is too slow for the gains"),
    ],
)
def test_a_swing_is_named_once_with_its_size_and_its_likely_cause(
    late_s: float, margin_used: float, cause: str
) -> None:
    swinging = Swinging(late_s, margin_used)
    swinging.run(40.0)
    assert swinging.logged == []
    swinging.run(30.0)
    ((at_s, kind, text, number, details),) = swinging.logged
    assert (kind, number, details["begins"]) == ("limit_cycle", 2, True)
    assert 5 * PERIOD_S < at_s < 6.5 * PERIOD_S
    assert text.startswith(f"swings about its slot by 3.0 m to either side, every 8.0 s: {cause}")
    assert details["amplitude_m"] == pytest.approx(3.0, rel=0.01)
    assert details["period_s"] == pytest.approx(PERIOD_S, rel=0.01)
    assert details["late_s"] == pytest.approx(late_s, abs=0.005)


def test_its_end_is_said_once_too() -> None:
    swinging = Swinging()
    swinging.run(60.0)
    swinging.run(30.0, 0.0)
    begun, ended = swinging.logged
    assert ended.text == "no longer swings about its slot"
    assert (ended.at_s, ended.details) == (pytest.approx(60.0 + PERIOD_S / 2, abs=PERIOD_S / 2), {"begins": False})
    assert begun.vehicle == ended.vehicle == 2


@pytest.mark.parametrize(
    "given",
    [
        {"yielding": [False, True]},
        {"replaced": [(False,) * 3, (False, True, False)]},
        {"error_of": lambda _: (9.0, math.nan, 9.0)},
    ],
    ids=["avoids it", "its lateral setpoint is replaced", "it has no slot"],
)
def test_an_error_that_says_nothing_of_its_loops_does_not_count_and_begins_again(given: dict[str, Any]) -> None:
    swinging = Swinging()
    swinging.run(70.0, **given)
    assert swinging.logged == []
    swinging.run(38.0)
    swinging.run(0.1, **given)
    swinging.run(38.0)
    assert swinging.logged == []
    swinging.run(20.0)
    assert len(swinging.logged) == 1


def test_nothing_is_said_of_it_while_it_avoids_another() -> None:
    swinging = Swinging()
    swinging.run(60.0)
    swinging.run(30.0, yielding=[False, True])
    assert len(swinging.logged) == 1


@pytest.mark.parametrize("unknown", ["uplink", "state"])
def test_without_a_known_answer_its_time_is_none(unknown: str) -> None:
    swinging = Swinging(0.5)
    if unknown == "uplink":
        swinging.uplink_s = math.nan
    else:
        swinging.seen.state = None
        swinging.seen = SimpleNamespace(state=SimpleNamespace(heading_rad=0.0), stamp=Instant(0))
    swinging.run(70.0)
    assert swinging.logged[0].details["late_s"] is None
    assert "its model seems right" in swinging.logged[0].text


def test_the_feature_is_this_stage_and_watches_every_vehicle() -> None:
    (stage,) = FEATURE.stages(Swinging().cycle)
    assert isinstance(stage, LimitCycles)
    assert len(stage._swings) == len(stage._answers) == 2


def zigzag(widths_m: list[float], times_s: list[float] | None = None, *, sign: float = 1.0) -> tuple[Swings, float]:
    """Return the swings of an error that goes from one extremum to the next in straight lines, and the time."""
    swings, time_s, error_m = Swings(), 0.0, 7.0
    swings.add(time_s, error_m)
    for width_m, seconds in zip(widths_m, times_s or [4.0] * len(widths_m), strict=True):
        for _ in range(40):
            time_s += seconds / 40
            error_m += sign * width_m / 40
            swings.add(time_s, error_m)
        sign = -sign
    return swings, time_s


def steady(widths_m: list[float], times_s: list[float] | None = None, *, still: bool = False) -> bool:
    swings, time_s = zigzag(widths_m, times_s)
    return swings.steady(time_s, still=still)


@pytest.mark.parametrize("still", [False, True])
def test_ten_swings_are_needed(still: bool) -> None:
    """The last one hasn't ended yet."""
    assert not steady([6.0] * 10, still=still)
    assert steady([6.0] * 11, still=still)


@pytest.mark.parametrize(("amplitude_m", "begins", "goes_on"), [(1.03, True, True), (0.97, False, True)])
def test_an_amplitude_of_a_metre_begins_it_and_half_of_it_ends_it(
    amplitude_m: float, begins: bool, goes_on: bool
) -> None:
    widths_m = [2.0 * amplitude_m] * 12
    assert (steady(widths_m), steady(widths_m, still=True)) == (begins, goes_on)


@pytest.mark.parametrize(("off", "begins", "goes_on"), [(0.23, True, True), (0.27, False, True), (0.53, False, False)])
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("of", ["width", "time"])
def test_a_quarter_of_difference_begins_it_and_half_of_it_ends_it(
    of: str, sign: int, off: float, begins: bool, goes_on: bool
) -> None:
    """Swings there and back differ from their mean by this share."""
    apart = [1.0 + off * sign, 1.0 - off * sign] * 6
    widths_m = [6.0 * share for share in apart] if of == "width" else [6.0] * 12
    times_s = [4.0 * share for share in apart] if of == "time" else None
    assert steady(widths_m, times_s) is begins
    assert steady(widths_m, times_s, still=True) is goes_on


def test_only_the_newest_ten_count() -> None:
    assert steady([20.0, 20.0] + [6.0] * 12)
    swings, _ = zigzag([20.0, 20.0] + [6.0] * 12)
    assert (swings.amplitude_m, swings.period_s) == (pytest.approx(3.0), pytest.approx(8.0))


def test_a_swing_is_overdue_after_a_whole_period() -> None:
    swings, time_s = zigzag([6.0] * 12)
    begun_s = time_s - 4.0
    assert swings.steady(begun_s + 7.9, still=True)
    assert not swings.steady(begun_s + 8.1, still=True)


def test_turns_of_less_than_a_metre_are_no_swings() -> None:
    swings, _ = zigzag([6.0, 0.9] * 20)
    assert not swings._widths_m
    swings, _ = zigzag([6.0, 1.2] * 3)
    assert swings._widths_m == pytest.approx([6.0, 1.2, 6.0, 1.2, 6.0])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_first_swing_may_go_either_way(sign: float) -> None:
    swings, _ = zigzag([5.0, 6.0, 7.0, 8.0], sign=sign)
    assert swings._widths_m == pytest.approx([5.0, 6.0, 7.0])
    assert swings._times_s == pytest.approx([4.0] * 3)


def test_an_answer_needs_three_periods() -> None:
    short, enough = Answer(), Answer()
    for answer, seconds in ((short, 2.9 * PERIOD_S), (enough, 3.1 * PERIOD_S)):
        for tick in range(round(seconds / TICK_S)):
            at_s = 50.0 + tick * TICK_S
            answer.add(at_s, math.sin(RADPS * at_s), at_s, math.sin(RADPS * (at_s - 0.3)))
    assert math.isnan(short.late_s(PERIOD_S, 0.0))
    assert enough.late_s(PERIOD_S, 0.0) == pytest.approx(0.3)
    enough.clear()
    assert math.isnan(enough.late_s(PERIOD_S, 0.0))


@pytest.mark.parametrize("late_s", [0.1, 2.0, 5.0, 7.5])
def test_an_answer_is_known_up_to_a_whole_period(late_s: float) -> None:
    """Of the newest three periods: what was before isn't looked at."""
    answer = Answer()
    for tick in range(600):
        at_s, before = tick * TICK_S, tick < 350
        answer.add(at_s, math.sin(RADPS * at_s), at_s, math.sin(RADPS * (at_s - late_s)) + (at_s**2 if before else 0))
    assert answer.late_s(PERIOD_S, 0.0) == pytest.approx(late_s)
    shift_s = math.atan(RADPS * 1.5) / RADPS
    assert answer.late_s(PERIOD_S, 1.5) == pytest.approx(late_s - shift_s)
