from dataclasses import replace
from io import BytesIO
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from formation_scenario.gains import redesigned
from formation_scenario.slot_assignment import slot_schedule
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.report import load_run
from gcs_formation.report.error_figures import WIDTHS, disturbance, errors, transient_end_s
from gcs_formation.report.loop_figures import followed, gains, latency
from gcs_formation.report.page import PLATES, embedded, write_figures
from gcs_formation.report.plan_figures import snapshot, snapshot_ticks
from gcs_formation.report.style import (
    INK,
    Mark,
    axes_grid,
    marks,
    new_figure,
    print_style,
    save,
)
from gcs_formation.report.time_axes import Group, draw_marks, everyone, span

QUICKSTART = Path(__file__).parents[3] / "configs" / "quickstart.yaml"
STRAIGHT: dict[str, object] = {"duration_s": 40, "path": {"waypoints_m": [[0, 0, 200], [4000, 0, 200]]}}


def straight(vehicles, **keys):
    return load_scenario({**STRAIGHT, "vehicles": vehicles, **keys})


@pytest.fixture
def eventful(reported):
    return reported.run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "options"),
    [
        (None, {"crash": True, "truth": False, "unseen": slice(300, 900)}),
        (None, {"truth": False, "unseen": slice(None)}),
        (None, {"flown_s": 3.0}),
        (None, {"flown_s": 0.0}),
        (None, {"flown_s": 20.0, "begun": False}),
        (straight([{"id": 1, "role": "leader"}]), {}),
        (straight([{"id": 2}, {"id": 3}]), {}),
        (straight({"count": 40}, formation={"shape": "triangle"}), {}),
    ],
    ids=[
        "crash, by telemetry",
        "never seen",
        "ended early",
        "one tick",
        "never begun",
        "alone",
        "virtual leader",
        "40",
    ],
)
def test_every_kind_of_run_can_be_drawn(make_run, scenario, options):
    run = load_run(make_run(scenario, **options))
    with print_style():
        for draw in (draw for draw, has_something in PLATES.items() if has_something(run)):
            figure = draw(run)
            figure.savefig(BytesIO(), format="raw", dpi=30)
            assert figure.get_figwidth() * 2.54 == pytest.approx(16.0)
            for legend in figure.legends:
                box = legend.get_window_extent()
                assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width, "a legend hangs over the edge"
            assert 3.0 < figure.get_figheight() * 2.54 < 20.0


def left_out(run):
    return {draw.__name__ for draw, has_something in PLATES.items() if not has_something(run)}


def test_a_figure_that_would_be_empty_is_left_out(make_run):
    assert left_out(load_run(make_run(flown_s=5.0))) == {"disturbance"}
    alone = load_run(make_run(straight([{"id": 1, "role": "leader"}]), flown_s=5.0))
    assert left_out(alone) == {"disturbance", "errors", "steps", "gains"}


def test_an_older_figure_that_is_left_out_now_is_removed(make_run, tmp_path, monkeypatch):
    monkeypatch.setattr("gcs_formation.report.page.PLATES", {disturbance: PLATES[disturbance]})
    (tmp_path / "disturbance.png").touch()
    assert list(write_figures(load_run(make_run(flown_s=5.0)), tmp_path)) == []
    assert list(tmp_path.iterdir()) == []


def with_column(run, vehicle, name, values):
    """Return the run with one column of the flown time replaced."""
    own = {**run.flown.vehicles, vehicle: {**run.flown.vehicles[vehicle], name: values}}
    return replace(run, flown=RecordedFlight(own))


@pytest.mark.parametrize("count", [6, 30])
def test_the_delayed_link_is_found_among_many(make_run, count):
    run = load_run(make_run(straight({"count": count}, formation={"shape": "triangle"}), flown_s=10.0))
    slow = run.followers[3]
    run = with_column(run, slow, "delay_s", np.full(run.time_s.size, 0.3))
    with print_style():
        delays, *_ = latency(run).axes
    name = f"vehicle {slow}" + (" (longest delay)" if count > 21 else "")
    lines = {line.get_label(): line for line in delays.get_lines()}
    assert np.nanmedian(np.asarray(lines[name].get_ydata(), dtype=float)) == pytest.approx(300.0)
    assert [line.get_color() for line in delays.get_lines()].count(lines[name].get_color()) == 1


def test_a_vehicle_that_fell_silent_leaves_the_ages_of_the_others_readable(make_run):
    run = load_run(make_run(flown_s=40.0))
    lost, silent = run.followers[0], np.maximum(run.time_s - 5.0, 0.1)
    run = with_column(run, lost, "age_s", silent)
    run = with_column(run, lost, "active", (silent < 5.0).astype(float))
    with print_style():
        ages = latency(run).axes[1]
    assert ages.get_yscale() == "linear"
    assert ages.get_ylim()[1] < 2000.0
    assert [text.get_text() for text in ages.texts] == ["a silent vehicle: up to 5.0 s"]


def test_twenty_followers_have_a_line_each_that_no_other_has():
    vehicles = tuple(VehicleId(0, i) for i in range(1, 22))
    group = Group(vehicles, vehicles[0], None)
    assert not group.banded
    assert len({tuple(group.look(vehicle).values()) for vehicle in vehicles}) == len(vehicles)


def test_matplotlibs_settings_are_left_as_they_were(reported):
    assert reported.settings_kept


@pytest.mark.parametrize("name", [draw.__name__ for draw in PLATES])
def test_every_figure_is_a_png_for_print(reported, name):
    with Image.open(reported.directory / "figures" / f"{name}.png") as image:
        assert image.format == "PNG"
        assert image.width == pytest.approx(16.0 / 2.54 * 200, abs=1)
        assert 300 < image.height < 1800
        darkest, lightest = image.convert("L").getextrema()
        assert (darkest, lightest) == (0, 255)


@pytest.mark.slow
def test_letters_are_at_least_8_points(eventful):
    with print_style():
        for draw in PLATES:
            texts = [text for text in draw(eventful).findobj(Text) if text.get_text()]
            assert texts
            assert min(float(text.get_fontsize()) for text in texts) >= 8.0


def test_what_happened_is_marked_in_order(eventful):
    assert [(round(mark.time_s), mark.label) for mark in marks(eventful)] == [
        (30, "link lost (4)"),
        (40, "delay 300 ms (2)"),
        (60, "square"),
        (70, "up delay 200 ms (3)"),
        (80, "disturbance"),
        (85, "disturbance over"),
        (88, "leader 3"),
        (90, "crash (3)"),
    ]


def test_nothing_after_the_end_is_marked(make_run):
    scenario = load_scenario(QUICKSTART, ["disturbances=[{at_s: 80, velocity_mps: [0.6, 0.6, 0]}]"])
    assert marks(load_run(make_run(scenario, flown_s=20.0))) == []


def test_names_of_marks_are_at_their_lines_and_none_lies_on_another():
    """The flight of a leader that freezes for a while, on axes as narrow as those of a transient."""
    happened = {
        6.2: "disturbance (1, 2, 4)",
        13.8: "freeze (1)",
        17.0: "leader 2",
        17.8: "freeze over (1)",
        28.0: "link",
    }
    with print_style():
        figure = new_figure(8.0)
        grid = axes_grid(figure, 3, 2, sharex="col", width_ratios=WIDTHS)
        for column, (begin_s, end_s) in enumerate([(0.0, 30.0), (30.0, 80.0)]):
            span(grid[0][column], (begin_s, end_s))
        columns = list(zip(*grid, strict=True))
        draw_marks(columns, [Mark(*each) for each in happened.items()])
        figure.savefig(BytesIO(), format="raw")
    names = {text.get_text(): text.get_window_extent() for text in grid[0][0].texts if text.get_text()}
    assert list(names) == [*happened.values()][::-1]
    for one, other in combinations(names.values(), 2):
        assert one.y1 <= other.y0 or other.y1 <= one.y0 or one.x1 <= other.x0 or other.x1 <= one.x0
    for time_s, label in happened.items():
        line = grid[0][0].transData.transform((time_s, 0.0))[0]
        assert names[label].x0 - 3.0 <= line <= names[label].x1 + 3.0
    assert figure.get_figheight() * 2.54 > 8.0


def test_snapshots_show_the_commanded_slots(eventful):
    before, after = [step.positions_m[1:] for step in slot_schedule(eventful.scenario)]
    for tick in snapshot_ticks(eventful):
        expected = before if float(eventful.time_s[tick]) < 60.0 else after
        np.testing.assert_allclose(snapshot(eventful, tick).slots_m, expected[:, [1, 0]], atol=1e-6)


def test_a_snapshot_is_of_those_that_fly_around_the_present_leader(make_run):
    run = load_run(make_run(flown_s=20.0))
    lost, heir = run.scenario.vehicles[0].vehicle_id, run.followers[0]
    own = {vehicle: dict(columns) for vehicle, columns in run.flown.vehicles.items()}
    own[lost] |= dict.fromkeys(("leads", "airborne"), np.zeros(run.time_s.size))
    own[heir]["leads"] = np.ones(run.time_s.size)
    still = snapshot(replace(run, flown=RecordedFlight(own)), 150)
    places = dict(zip(own, still.positions_m, strict=True))
    assert places[heir] == pytest.approx(0.0)
    assert np.isnan(places[lost]).all()
    assert np.isfinite(places[run.followers[1]]).all()


def test_a_leader_that_follows_another_later_on_has_errors_too(make_run):
    run = load_run(make_run(flown_s=20.0))
    first, heir = run.scenario.vehicles[0].vehicle_id, run.followers[0]
    assert first not in run.followers
    own = {vehicle: dict(columns) for vehicle, columns in run.flown.vehicles.items()}
    own[heir]["leads"] = (run.time_s > 10.0).astype(float)
    own[first] |= {"leads": 1.0 - own[heir]["leads"], "active": np.ones(run.time_s.size)}
    passed_on = replace(run, flown=RecordedFlight(own))
    assert passed_on.followers == (*run.followers, first)
    assert sorted(everyone(passed_on).vehicles) == sorted(own)
    assert embedded(passed_on)["meta"]["vehicles"] == [str(vehicle) for vehicle in own]
    assert INK in [line.get_color() for line in errors(passed_on).axes[0].get_lines()]


def test_gains_are_of_a_follower_that_follows_to_the_end(make_run):
    run = load_run(make_run(flown_s=20.0))
    worst = run.worst_first()[0]
    led = {name: np.where(run.time_s > 10.0, np.nan, values) for name, values in run.flown.vehicles[worst].items()}
    relieved = replace(run, flown=RecordedFlight({**run.flown.vehicles, worst: led}))
    assert relieved.worst_first()[0] == worst
    assert all(np.isfinite(line.get_ydata()).all() for axes in gains(relieved).axes for line in axes.get_lines()[:3])


def test_gains_designed_again_in_flight_are_the_nominal_ones(make_run):
    scenario = straight([{"id": 1, "role": "leader"}, {"id": 2}], law={"gains": "auto"})
    run = load_run(make_run(scenario, flown_s=20.0))
    slower = redesigned(run.scenario, 0.3).law.speed.kp
    assert slower < 0.9 * run.scenario.law.speed.kp
    late = replace(run, events=(*run.events, {"kind": "design", "design_delay_s": 0.3}))
    before, after = (np.asarray(gains(each).axes[0].get_lines()[0].get_ydata(), dtype=float) for each in (run, late))
    np.testing.assert_allclose(after, before * run.scenario.law.speed.kp / slower)


def test_a_snapshot_is_taken_before_the_shape_changes(eventful):
    times = eventful.time_s[snapshot_ticks(eventful)]
    assert times[0] == pytest.approx(0.0, abs=1e-9)
    assert times[-1] == pytest.approx(120.0)
    assert ((times > 55.0) & (times < 60.0)).any()


def test_what_follows_the_transient_is_steady(make_run):
    run = load_run(make_run())
    split_s = transient_end_s(run)
    assert split_s is not None
    errors = np.stack([run.flown.error(vehicle) for vehicle in run.followers])
    assert np.abs(errors[:, run.time_s >= split_s]).max() < 0.15
    assert np.abs(errors[:, run.time_s < split_s]).max() > 5.0


def test_a_crash_is_no_transient(make_run):
    run = load_run(make_run(crash=True))
    split_s = transient_end_s(run)
    assert split_s is None or split_s < 60.0


def test_headings_go_on_through_south_without_jumps(make_run):
    circle = [[600 * np.sin(a), 600 * (1 - np.cos(a)), 200] for a in np.linspace(0, 1.9 * np.pi, 12)]
    scenario = straight({"count": 2}, path={"waypoints_m": np.round(circle).tolist()}, duration_s=150)
    run = load_run(make_run(scenario, truth=False))
    setpoint, response = followed(run, run.followers[0], "heading")
    wrapped = run.flown.vehicles[run.followers[0]]["heading_rad"]
    assert np.abs(np.diff(wrapped)).max() > 6.0
    assert np.abs(np.diff(response)).max() < 1.0
    assert np.abs(setpoint - response).max() < 2.0
    np.testing.assert_allclose(np.exp(1j * np.radians(response)), np.exp(1j * wrapped), atol=1e-9)


@pytest.mark.parametrize(("kind", "begins"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")])
def test_a_figure_for_a_paper_has_the_same_bytes_each_time(kind, begins, tmp_path):
    written = []
    for name in ("one", "other"):
        file = tmp_path / name / f"figure.{kind}"
        file.parent.mkdir()
        drawn = new_figure(4.0)
        drawn.subplots().plot([0, 1], [0, 1])
        save(drawn, file, kind)
        written.append(file.read_bytes())
    assert written[0] == written[1]
    assert written[0].startswith(begins)
