"""What the documents state as headlines are figures of held-out flights, and a figure that isn't theirs is found."""

from __future__ import annotations

import re
from functools import partial
from itertools import pairwise
from random import Random

import pytest

from benchmarks import PAPER
from benchmarks.headlines import Case, Figure, Flight, Found, fly, pages
from benchmarks.headlines.cases import CASES
from formation_scenario import load_scenario

FIGURES = {name for case in CASES for name in case.names()}
STATED = [(document, name, text) for document in pages.documents() for name, text in pages.stated(document)]


def test_documents_state_every_figure_and_no_other():
    assert {name for _, name, _ in STATED} == FIGURES


def test_a_figure_is_the_same_in_all_documents():
    texts = {name: {text for _, each, text in STATED if each == name} for name in FIGURES}
    assert {name for name, each in texts.items() if len(each) != 1} == set()


def test_every_mark_is_read():
    for document in pages.documents():
        text = document.read_text(encoding="utf-8")
        assert len(re.findall("<!-- figure:", text)) == len(list(pages.stated(document))), document.name


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_draws_ten_flights_or_more_none_of_which_is_another_or_the_shipped_one(case):
    drawn = [case.draw(Random(f"{case.name} {number} 0")) for number in range(case.count)]
    again = [case.draw(Random(f"{case.name} {number} 0")) for number in range(case.count)]
    assert drawn == again
    assert len(drawn) >= 10
    paths = [each.keys["path__waypoints_m"] for each in drawn]
    shipped = [list(each) for each in load_scenario(PAPER).path.waypoints_m]
    assert all(one != other for one, other in pairwise(sorted(paths)))
    assert all(each != shipped[: len(each)] for each in paths)


def found(*values, digits=2, worst=max):
    return Found("case.x", values, Figure("error_x_m.max", digits, worst))


def test_the_worst_of_the_flights_is_stated():
    assert found(0.1, 0.3, 0.2).text == "0.30"
    assert found(9.0, 7.04, 8.0, digits=1, worst=min).text == "7.0"


def test_a_stated_figure_may_be_off_by_the_flights_spread_or_its_last_digit_and_no_more():
    scattered = found(1.0, 2.0, 3.0)  # standard deviation 0.82
    assert (scattered.agrees("3.8"), scattered.agrees("3.83"), scattered.agrees("2.1")) == (True, False, False)
    assert (found(1.0, 1.0).agrees("1.01"), found(1.0, 1.0).agrees("1.02")) == (True, False)
    assert not found(1.0, float("nan"), 2.0).agrees("2.0")


def test_figures_are_written_into_a_document_by_their_names(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("| <!-- figure: a.x -->0.1<!-- /figure --> m | <!-- figure: b.y -->7<!-- /figure --> |")
    assert pages.write(page, {"a.x": "0.25"})
    assert list(pages.stated(page)) == [("a.x", "0.25"), ("b.y", "7")]
    assert not pages.write(page, {"a.x": "0.25"})


def held(keys, _random):
    return Flight(keys, 1.0, 4.0)


@pytest.mark.slow
def test_a_case_is_flown_with_its_draw_and_judged_over_its_window():
    straight = {"path__waypoints_m": [[0, 0, 200], [900, 0, 200]], "disturbances": [], "start__offset_m": [0, 0, 0]}
    pushed = straight | {"disturbances": [{"at_s": 2, "vehicles": [3], "velocity_mps": [0.5, 0, 0]}]}
    figures = {"x": Figure("error_x_m.max"), "until": Figure(lambda summary, _: summary.to_dict()["duration_s"])}
    calm, gust = (fly(Case("t", PAPER, partial(held, keys), figures), 0) for keys in (straight, pushed))
    assert calm["x"] < 0.01
    assert gust["x"] > 0.1
    assert calm["until"] == pytest.approx(4.0, abs=0.2)
