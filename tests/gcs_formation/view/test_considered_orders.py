"""What an order would be answered is known before it is given, and asking changes nothing."""

from __future__ import annotations

from pathlib import Path

import gcs_formation
from formation_scenario.orders import Answer
from tests.flights.conftest import scenario

ORDERS = ("spacing 4000", "speed 500", "heading 90", "leader 9", "shape nonsense", "jump", "shape line", "loiter")


def test_an_order_is_answered_as_it_was_considered(tmp_path: Path) -> None:
    keys = scenario(duration_s=3, vehicles={"count": 3}, start={"in_air": True})
    answers = list[tuple[Answer, Answer]]()
    with gcs_formation.Flight(keys, out=tmp_path / "run") as flight:
        next(tick for tick in flight if tick.mission_time_s > 1.0)
        session = flight._flying.session
        orders, now, controller = session.station.orders, session.clock.now(), session.station.controller
        for order in ORDERS:
            before = controller.plan.arrangement
            considered = orders.consider(order, now)
            assert controller.plan.arrangement == before
            answers.append((considered, orders.execute(order, now)))
    assert [given.accepted for _, given in answers] == [False] * 6 + [True] * 2
    for considered, given in answers:
        assert considered.accepted == given.accepted
        assert given.accepted or considered.text == given.text


def test_links_are_changed_by_the_keys_of_a_scenario(tmp_path: Path) -> None:
    with gcs_formation.Flight(scenario(duration_s=3, vehicles={"count": 2}), out=tmp_path / "run") as flight:
        next(iter(flight))
        answer = flight._flying.session._answer
        assert answer('link {"vehicles": [2], "delay_ms": 100}').accepted
        for wrong in ('{"vehicles": [7]}', '{"delay": 3}', "{", '{"loss": 2}', "[]", '{"vehicles": "all"}'):
            refused = answer(f"link {wrong}")
            assert not refused.accepted
            assert refused.text
        assert answer("check loiter").text == "loiter: can be done"
    events = (tmp_path / "run" / "events.jsonl").read_text()
    assert "link of 2: delay_ms 100.0" in events
