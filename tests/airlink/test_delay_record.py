"""What the proxy records is what a scenario replays."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pytest

from airlink.clock import Instant, after
from airlink.delay_record import DelayRecord
from airlink.frame import FrameWriter
from airlink.impairment import Direction, Impairment
from airlink.messages.system import Timesync
from airlink.radio.settings import RadioSettings
from airlink.relay import Relay
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.reading import read_trace

UP, DOWN = Direction.UPLINK, Direction.DOWNLINK


class Kept(io.StringIO):
    """A file whose text is known after it was closed."""

    text = ""

    def close(self) -> None:
        self.text = self.getvalue()
        super().close()


def at(seconds: float) -> Instant:
    return after(Instant(0), seconds)


def drained(relay: Relay, until: Instant) -> None:
    while (timer := relay.next_timer()) is not None and timer <= until:
        relay.pop_due(timer)


def test_delays_and_losses_of_each_direction_are_read_again_as_they_were(tmp_path: Path) -> None:
    relay, file = Relay(1), Kept()
    relay.impairments[UP] = Impairment(0.2, 0.05, "pareto", loss=0.2)
    relay.impairments[DOWN] = Impairment(0.1)
    with DelayRecord(file) as record:
        relay.record = record
        for number in range(600):
            now = at(5.0 + 0.1 * number)
            drained(relay, now)
            for direction in Direction:
                relay.accept((0, direction, b"x" * 50), now)
    (tmp_path / "record.csv").write_text(file.text)
    up, down = (
        read_trace(Trace(file=str(tmp_path / "record.csv"), column=f"{name}_ms", time=f"{name}_t_s"))
        for name in ("uplink", "downlink")
    )
    sent = relay.statistics(UP)
    assert len(up.delays_ms) == sent.datagrams == 600
    assert sum(map(math.isnan, up.delays_ms)) == sent.lost > 80
    assert up.mean_ms == pytest.approx(1e3 * sent.mean_delay_s, abs=0.01)
    assert up.times_s[1] == pytest.approx(0.1)
    assert set(down.delays_ms) == {100.0}


def test_time_requests_that_pass_the_proxy_measure_what_lies_beyond() -> None:
    relay, file, ground, vehicle = Relay(1), Kept(), FrameWriter(255, 1), FrameWriter(1, 1)
    relay.impairments.update(dict.fromkeys(Direction, Impairment(0.2)))
    with DelayRecord(file) as record:
        relay.record = record
        relay.accept((0, UP, ground.encode(Timesync(0, 77))), at(1.0))
        drained(relay, at(1.2))
        relay.accept((0, DOWN, vehicle.encode(Timesync(5, 77))), at(1.23))
        drained(relay, at(9.0))
    rows = [line.split(",") for line in file.text.splitlines()[1:]]
    assert ["0.200000", "30.000"] in [row[4:] for row in rows]


def test_a_round_trip_beyond_is_from_being_sent_on_to_the_answer(tmp_path: Path) -> None:
    file, writer = Kept(), FrameWriter(1, 1)
    with DelayRecord(file) as record:
        for number, answered in enumerate((True, False, True)):
            stamp = 7 + number
            record.sent_on(0, writer.encode(Timesync(0, stamp)), at(1.0 + number))
            record.came(1, writer.encode(Timesync(9, stamp)), at(1.01 + number))  # another remote's
            if answered:
                record.came(0, writer.encode(Timesync(9, stamp)), at(1.04 + number))
        record.sent_on(0, b"", at(20.0))
    (tmp_path / "record.csv").write_text(file.text)
    record_of = read_trace(Trace(file=str(tmp_path / "record.csv"), column="rtt_ms", time="rtt_t_s"))
    assert record_of.delays_ms == (pytest.approx(20.0), pytest.approx(math.nan, nan_ok=True), pytest.approx(20.0))
    assert record_of.times_s == (0.0, 1.0, 2.0)


def test_rows_are_in_the_order_of_their_times_whatever_became_known_first() -> None:
    file = Kept()
    with DelayRecord(file) as record:
        record.carried(UP, at(2.0), 0.1)
        record.sent_on(0, b"", at(2.5))
        record.carried(UP, at(3.0), None)
        record.carried(UP, at(2.0), 1.5)
        record.carried(UP, at(2.4), 0.9)
        record.sent_on(0, b"", at(90.0))
        assert len(file.getvalue().splitlines()) == 5
    assert [row.split(",")[1] for row in file.text.splitlines()[1:]] == ["100.000", "1500.000", "900.000", ""]


def test_waiting_for_a_radio_and_what_it_drops_are_in_the_record(tmp_path: Path) -> None:
    relay = Relay(1, RadioSettings(8e3, 8e3, buffer_bytes=300, reports=False))
    with DelayRecord(file := Kept()) as record:
        relay.record = record
        for _ in range(5):
            relay.accept((0, DOWN, b"x" * 100), at(0.0))
        while (timer := relay.next_timer()) is not None:
            relay.pop_due(timer)
    (tmp_path / "record.csv").write_text(file.text)
    rows = [line.split(",")[2:4] for line in file.text.splitlines()[1:]]
    assert sorted(rows) == [["0.000000", text] for text in ("", "100.000", "200.000", "300.000", "400.000")]
