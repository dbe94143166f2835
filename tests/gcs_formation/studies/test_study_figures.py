"""Figures of a study: distributions and their bands, parameters that aren't numbers, margins against theory."""

import re
from itertools import product
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from gcs_formation.studies.curves import by_level, distributions, exceedances, split_by, up_to, worse_than
from gcs_formation.studies.dataset import Dataset
from gcs_formation.studies.ended_flights import Flights, flights_of
from gcs_formation.studies.figures import (
    crossings_of,
    edges_of,
    heat_maps,
    marginals,
    most_influential,
    pairs,
    searched,
)
from gcs_formation.studies.intervals import share_interval
from gcs_formation.studies.preparation import load_study
from gcs_formation.studies.report import write_study_report

SCENARIO: Any = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
DELAY, LOSS, LAW = "links.default.delay_ms", "links.default.loss", "law.type"
ERROR, NEAREST = "error_x_m.max", "min_separation_m"
SEARCH = {"parameter": DELAY, "low": 0, "high": 1000, "tolerance": 10, "metric": ERROR, "below": 1.0}


def study(**keys):
    return load_study({"base": SCENARIO, **keys})[0]


def lines_of(axes, label):
    return [line for line in axes.lines if isinstance(line, Line2D) and line.get_label() == label]


def places_of(axes, label):
    return [np.asarray(line.get_xdata()).tolist() for line in lines_of(axes, label)]


def independent(kept, flights):
    return share_interval([(1, 1)] * kept + [(0, 1)] * (flights - kept), 0.95)


def test_a_distribution_s_band_is_that_of_the_share_and_flights_without_the_figure_are_beyond_it():
    curve = up_to(np.array([*range(80), *[np.nan] * 20], dtype=float))
    assert curve.share[[0, -1]] == pytest.approx([0.01, 0.8])
    for place in (0, 79):
        assert (curve.low[place], curve.high[place]) == independent(place + 1, 100)
    assert all(np.diff(curve.low) >= 0)
    assert all(np.diff(curve.high) >= 0)
    for place in range(80):
        low, high = independent(place + 1, 100)
        assert curve.low[place] <= low < high <= curve.high[place]


def test_a_band_is_by_clusters_of_flights():
    """Ten seeds of each of eight samples that all agree say as much as eight flights."""
    values, samples = np.repeat(np.arange(8.0), 10), np.repeat(np.arange(8.0), 10)
    for curve in (up_to(values, samples), worse_than(-values, samples, lower_is_worse=True)):
        assert (curve.low[39], curve.high[39]) == pytest.approx(independent(4, 8), abs=0.02)
    alone = up_to(values)
    assert alone.high[39] - alone.low[39] < 0.25 < curve.high[39] - curve.low[39]


def test_a_tail_s_band_is_of_the_flights_that_are_worse():
    values = np.array([3.0, 1.0, 4.0, 2.0, np.nan])
    curve = worse_than(values, lower_is_worse=False)
    assert curve.values.tolist() == [1, 2, 3, 4]
    assert curve.share == pytest.approx([0.8, 0.6, 0.4, 0.2])
    least = worse_than(values, lower_is_worse=True)
    assert least.values.tolist() == [4, 3, 2, 1]
    for each in (curve, least):
        expected = [independent(worse, 5) for worse in (4, 3, 2, 1)]
        assert np.stack((each.low, each.high), axis=1) == pytest.approx(np.array(expected))
    none_worse = worse_than(np.arange(10.0), lower_is_worse=False)
    assert (none_worse.low[-1], none_worse.high[-1]) == pytest.approx(independent(0, 10))


def test_a_tail_goes_on_beyond_its_worst_flight_to_what_is_expected():
    """None of 100 flights is worse than 4 m, so up to 3.6 % may be; the mark is at 1 %."""
    wanted = study(metrics=[ERROR, NEAREST], expect=[{"metric": NEAREST, "above": 2, "share": 0.99}])
    (axes,) = exceedances(Flights(wanted, {}, {NEAREST: np.linspace(4.0, 40.0, 100)})).axes
    (tail,) = lines_of(axes, "share of flights that are worse than this value")
    assert np.asarray(tail.get_xdata())[-1] < 2.0
    (mark,) = lines_of(axes, "allowed share beyond it")
    assert np.asarray(mark.get_xydata()) == pytest.approx(np.array([[2.0, 0.01]]))
    assert axes.xaxis_inverted()


def test_a_share_of_less_than_half_a_flight_is_no_mark_in_the_legend():
    """1 % of 20 flights would be below the panel, which ends at 2 %."""
    wanted = study(metrics=[ERROR, NEAREST], expect=[{"metric": NEAREST, "above": 2, "share": 0.99}])
    figure = exceedances(Flights(wanted, {}, {NEAREST: np.linspace(4.0, 40.0, 20)}))
    assert lines_of(figure.axes[0], "allowed share beyond it") == []
    assert "expected" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_a_count_that_few_flights_have_is_seen_among_a_thousand():
    broken = np.zeros(1000)
    broken[[97, 231]] = 1.0
    figure = distributions(Flights(study(), {}, {"broken_invariants": broken, ERROR: np.arange(1000.0) / 8}))
    counted, curve = figure.axes[:2]
    assert [text.get_text() for text in counted.texts] == ["998", "2"]
    assert [label.get_text() for label in counted.get_xticklabels()] == ["0", "1"]
    bars = [bar for bar in counted.patches if isinstance(bar, Rectangle)]
    assert len(bars) == len(counted.patches)
    assert all(bar.get_height() > counted.get_ylim()[0] for bar in bars)
    assert not curve.patches


def delayed(*, margin_s, **keys):
    """Return flights at 0, 100, 200, 300 ms, over links with and without loss, with a computed margin."""
    delay, loss = (values.ravel() for values in np.meshgrid([0.0, 100.0, 200.0, 300.0], [0.0, 0.1]))
    metrics = {ERROR: delay / 100, "margin_used": delay / 1e3 / margin_s}
    return Flights(study(parameters={DELAY: [0]}, **keys), {DELAY: delay, LOSS: loss}, metrics)


def test_a_heat_map_shows_where_delays_reach_the_computed_margin_and_a_figure_its_bound():
    """The margin of 150 ms is halfway between two levels; 1.25 m are reached at 125 ms."""
    wanted = [{"metric": ERROR, "below": 1.25}]
    (axes, _) = heat_maps(delayed(margin_s=0.15, expect=wanted), ERROR).axes
    for label, at in (("computed delay margin", 150.0), (f"{ERROR} = 1.25, as expected", 125.0)):
        assert places_of(axes, label) == [pytest.approx([at, at])] * 2
    (axes, _) = heat_maps(delayed(margin_s=0.5), ERROR).axes
    assert not axes.lines
    wide = delayed(margin_s=0.5, expect=[{"metric": ERROR, "below": 0.1}])
    wide = wide._replace(metrics={ERROR: 10.0 ** (wide.parameters[DELAY] / 50 - 3)})
    (axes, _) = heat_maps(wide, ERROR).axes
    assert places_of(axes, f"{ERROR} = 0.1, as expected") == [pytest.approx([100.0, 100.0])] * 2


def test_what_is_drawn_uniformly_by_its_logarithm_lies_so_on_its_axis():
    delay, loss = np.geomspace(10.0, 1000.0, 60), np.tile([0.0, 0.1], 30)
    drawn = study(parameters={DELAY: {"log_uniform": [10, 1000]}, LOSS: [0, 0.1]}, design="random", samples=60)
    flights = Flights(drawn, {DELAY: delay, LOSS: loss}, {ERROR: delay})
    for figure in (heat_maps(flights, ERROR), marginals(flights, ERROR)):
        axes = figure.axes[0]
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
        written = {label.get_text() for label in axes.get_xticklabels()}
        assert {"20", "50", "100", "200", "500"} <= written


def test_numbers_that_are_drawn_are_put_into_bins_however_few_they_are():
    """Otherwise each would be a level, and their six-digit names would overlap."""
    delay, loss = np.array([10.0, 11.0, 200.0, 390.0]), np.tile([0.0, 0.1], 2)
    drawn = study(parameters={DELAY: {"uniform": [10, 400]}, LOSS: [0, 0.1]}, design="random", samples=4)
    flights = Flights(drawn, {DELAY: delay, LOSS: loss}, {ERROR: delay})
    assert edges_of(flights, DELAY, 1).tolist() == [10.0, 105.5, 390.0]
    (axes, _) = heat_maps(flights, ERROR).axes
    assert "11" not in {label.get_text() for label in axes.get_xticklabels()}


def test_a_boundary_is_found_between_neighbours_that_are_known():
    assert crossings_of(np.arange(4.0), np.array([0.0, 2.0, np.nan, 0.0]), 1.0) == [0.5]
    assert crossings_of(np.arange(3.0), np.array([4.0, 2.0, 4.0]), 3.0) == [0.5, 1.5]


def by_law(**keys):
    """Return rows of 5 seeds with each of two laws at two delays; pid has 1 m more error."""
    keys = {"parameters": {LAW: ["pid", "fuzzy_pid"], DELAY: [0, 100]}, "seeds": {"count": 5}, **keys}
    planned = study(metrics=[ERROR], **keys)
    flown = enumerate(product(["pid", "fuzzy_pid"], [0, 100], range(1, 6)))
    rows: list[dict[str, Any]] = [
        {"flight": i, "seed": seed, LAW: law, DELAY: delay, ERROR: 0.1 * seed + (law == "pid"), "exit": 0,
         "wall_s": 1.0, "cpu_s": 1.0, "version": "x", "words": ""}
        for i, (law, delay, seed) in flown
    ]  # fmt: skip
    return planned, rows


def test_parameters_that_are_no_numbers_have_their_values_on_the_axes():
    flights = flights_of(*by_law())
    assert {name: mask.sum() for name, mask in flights.groups(LAW).items()} == {"pid": 10, "fuzzy_pid": 10}
    axes = marginals(flights, ERROR).axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["pid", "fuzzy_pid"]
    (medians,) = lines_of(axes, "median")
    assert np.asarray(medians.get_ydata()) == pytest.approx([1.3, 0.3])
    assert pairs(flights, ERROR) == [(DELAY, LAW)]
    assert pairs(flights_of(*by_law(design="one_at_a_time")), ERROR) == []
    (axes, _) = heat_maps(flights, ERROR).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["pid", "fuzzy_pid"]


def test_of_many_parameters_those_are_drawn_by_which_a_figure_differs_most():
    """The law changes 1 m, the seed a tenth of a metre, the delay nothing."""
    flights = flights_of(*by_law())
    assert most_influential(flights, ERROR, 2) == [LAW, DELAY]
    assert most_influential(flights, ERROR, 1) == [LAW]
    again = flights._replace(metrics={ERROR: flights.parameters[DELAY] + 0.01 * flights.metrics[ERROR]})
    assert most_influential(again, ERROR, 1) == [DELAY]


def test_names_of_values_stand_upright_where_they_have_no_room():
    planned, rows = by_law()
    axes = marginals(flights_of(planned, rows), ERROR).axes[0]
    assert {label.get_rotation() for label in axes.get_xticklabels()} == {0.0}
    for row in rows:
        row[LAW] += ", as it was told by the station"
    axes = marginals(flights_of(planned, rows), ERROR).axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == [
        "pid, as it was told by …",
        "fuzzy_pid, as it was …",
    ]
    assert {label.get_rotation() for label in axes.get_xticklabels()} == {90.0}


def test_each_value_of_a_parameter_has_a_curve_of_its_own():
    figure = by_level(flights_of(*by_law()), ERROR)
    left, right = figure.axes[:2]
    for axes, least, ends in ((left, 0.0, (1.5, 0.5)), (right, 0.15, (1.4, 0.4))):
        for law, end in zip(("pid", "fuzzy_pid"), ends, strict=True):
            places, shares = lines_of(axes, law)[0].get_data()
            assert np.asarray(places)[np.asarray(shares) > least][-1] == pytest.approx(end)


def test_what_is_expected_of_some_flights_is_drawn_at_them_alone():
    """The bound of 0.7 m is for fuzzy_pid only, 2 m for all, and 3 m for one law at one delay."""
    some = {"metric": ERROR, "below": 0.7, "share": 0.9, "where": {LAW: "fuzzy_pid"}}
    both = {"metric": ERROR, "below": 3, "where": {LAW: "pid", DELAY: 0}}
    flights = flights_of(*by_law(expect=[some, both, {"metric": ERROR, "below": 2}]))
    for axes in (distributions(flights).axes[0], exceedances(flights).axes[0]):
        assert places_of(axes, "expected") == [[2.0, 2.0]]
        assert lines_of(axes, "allowed share beyond it") == []
    law, delay, *_ = marginals(flights, ERROR).axes
    heights = [[np.asarray(line.get_ydata()).tolist() for line in lines_of(axes, "expected")] for axes in (law, delay)]
    assert heights == [[[2.0, 2.0], [0.7, 0.7]], [[2.0, 2.0]]]
    assert places_of(law, "expected")[1] == [0.5, 1.5]
    _, tails, *_ = by_level(flights, ERROR).axes
    own, of_all = lines_of(tails, "expected")
    assert (np.asarray(own.get_xdata())[0], np.asarray(of_all.get_xdata())[0]) == (0.7, 2.0)
    assert own.get_color() == lines_of(tails, "fuzzy_pid")[0].get_color()
    (mark,) = lines_of(tails, "allowed share beyond it")
    assert np.asarray(mark.get_xydata()) == pytest.approx(np.array([[0.7, 0.1]]))
    (axes, _) = heat_maps(flights, ERROR).axes
    assert not axes.lines


def test_where_nothing_is_left_to_chance_there_is_no_confidence_to_state():
    for keys, by_chance in (({}, True), ({"seeds": {"count": 1}}, False), ({"design": "random"}, True)):
        flights = flights_of(*by_law(**keys))
        bands = [*distributions(flights).axes[0].collections, *exceedances(flights).axes[0].collections]
        assert len(bands) == 2 * by_chance
        assert bool(split_by(flights)) is by_chance
    planned, rows = by_law()
    for alike in (True, False):
        same = [{**row, "digest": "same" if alike else row["seed"]} for row in rows]
        assert bool(flights_of(planned, same).chance.exact) is alike


def test_searches_stand_beside_the_margin_computed_for_their_loops():
    metrics = ["worst_loop_delay_s", "delay_margin_s"]
    planned = study(parameters={LAW: ["pid", "consensus"]}, bisect=SEARCH, metrics=metrics)
    rows = [
        {"flight": i, "seed": 1, LAW: law, DELAY: delay, ERROR: 0.5, "worst_loop_delay_s": delay / 500 + 0.1,
         "delay_margin_s": 0.9, "exit": 0}
        for i, (law, delay) in enumerate(product(["pid", "consensus"], [0.0, 400.0, 410.0, 1000.0]))
    ]  # fmt: skip
    found = [
        {"seed": 1, LAW: "pid", "kept": 400.0, "broken": 410.0},
        {"seed": 1, LAW: "consensus", "kept": 1000.0, "broken": None},
    ]
    assert planned.bisect is not None
    ends, loops = searched(flights_of(planned, rows), planned.bisect, found, rows).axes
    assert [label.get_text() for label in ends.get_yticklabels()] == ["pid", "consensus"]
    assert places_of(ends, "kept to broken") == [[400.0, 410.0]]
    assert places_of(ends, "kept up to the high end") == [[1000.0]]
    assert places_of(loops, "kept to broken") == [pytest.approx([0.9, 0.92])]
    assert places_of(loops, "computed delay margin") == [[0.9], [0.9]]


@pytest.mark.slow
def test_a_report_has_its_figures_as_files_and_in_the_page(tmp_path):
    planned, rows = by_law()
    rows[7][ERROR] = None
    with Dataset(tmp_path / "a study", planned, SCENARIO, resume=False, overwrite=False) as data:
        for row in rows:
            data.add(row)
    page = write_study_report(tmp_path / "a study").read_text(encoding="utf-8")
    names = {path.stem for path in (tmp_path / "a study" / "figures").glob("*.png")}
    assert names == {
        "distributions", "exceedances", f"levels-{ERROR}", f"marginals-{ERROR}", f"maps-{ERROR}",
    }  # fmt: skip
    assert all(f'id="figure-{name}"' in page for name in names)
    worst = re.findall(r"gcs-formation study fly &#x27;(.*)&#x27; (\d+)<", page)
    assert worst == [(f"{tmp_path}/a study", flight) for flight in ("7", "4", "9")]
