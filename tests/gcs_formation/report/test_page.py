import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from formation_scenario import load_scenario
from gcs_formation.report import load_run
from gcs_formation.report.page import PLATES, as_script, embedded
from gcs_formation.report.page_parts import beside_the_paper, cards, control, table, verdict

VOID = {"meta", "link", "img", "input", "br"}


class Outline(HTMLParser):
    """Collects elements opened and closed in order, their references, and the text outside scripts and styles."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.addresses, self.ids, self.words = [], [], set(), []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.addresses += [attributes[key] for key in ("src", "href", "action", "data", "srcset") if key in attributes]
        self.ids |= {attributes["id"]} if "id" in attributes else set()
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.words.append(data)


def data_of(text):
    return json.loads(text.partition('id="data">')[2].partition("</script>")[0])


def straight(count, duration_s, **keys):
    path = {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
    return load_scenario({"vehicles": {"count": count}, "duration_s": duration_s, "path": path, **keys})


@pytest.fixture
def report(reported):
    return reported.directory, reported.run, reported.page


def test_the_page_is_well_formed_and_needs_nothing_else(report):
    _, _, text = report
    outline = Outline(text)
    assert outline.open == []
    assert all(address.startswith(("data:", "#")) for address in outline.addresses)
    assert {address[1:] for address in outline.addresses if address.startswith("#")} <= outline.ids
    assert not re.search(r"https?://|@import|url\(", text)


def test_whatever_a_vehicle_says_stays_text(report):
    _, _, text = report
    assert "<b>EKF</b>" not in text
    assert "<b>EKF</b> & </script>" in Outline(text).words
    assert "<three> & $more" in Outline(text).words


def test_every_figure_is_in_the_page_and_in_its_directory(report):
    directory, _, text = report
    names = {draw.__name__ for draw in PLATES}
    assert {path.stem for path in (directory / "figures").glob("*.png")} == names
    assert {f"figure-{name}" for name in names} <= Outline(text).ids
    assert text.count('src="data:image/png;base64,iVBOR') == len(names)


def test_embedded_errors_are_recorded_ones_with_their_extremes(report):
    _, run, text = report
    data = data_of(text)
    names = [vehicle["name"] for vehicle in data["vehicles"]]
    assert [names[series["vehicle"]] for series in data["errors"]] == [str(vehicle) for vehicle in run.followers]
    for series, vehicle in zip(data["errors"], run.followers, strict=True):
        for column, axis in enumerate("xyz"):
            recorded = run.whole.error(vehicle)[:, column]
            shown = np.array(series[axis]["v"])
            assert shown.min() == pytest.approx(recorded.min(), abs=5.1e-5)
            assert shown.max() == pytest.approx(recorded.max(), abs=5.1e-5)
            at = np.searchsorted(run.whole_time_s, np.array(series[axis]["t"]) - 0.02)
            np.testing.assert_allclose(shown, recorded[at], atol=5.1e-5)


def test_embedded_tracks_are_recorded_places(report):
    _, run, text = report
    tracks = data_of(text)["tracks"]
    at = np.searchsorted(run.whole_time_s, np.array(tracks["t"]) - 0.02)
    for track, vehicle in zip(tracks["vehicles"], (run.leader, *run.followers), strict=True):
        shown = np.column_stack([track[name] for name in ("north", "east", "height")])
        np.testing.assert_allclose(shown, run.whole.place(vehicle)[at], atol=0.051)


@pytest.mark.slow
def test_a_hundred_vehicles_fit_in_2_megabytes(make_run):
    scenario = straight(100, 150, formation={"shape": "triangle"})
    data = embedded(load_run(make_run(scenario)))
    assert len(as_script(data).encode()) < 2_000_000
    assert len(data["errors"]) == 99


def test_the_embedded_ground_is_the_scenarios(make_run):
    hill = {"north_m": 900, "east_m": 200, "height_m": 80, "radius_m": 300}
    run = load_run(make_run(straight(3, 60, terrain={"hills": [hill], "clearance_m": 10})))
    ground = embedded(run)["ground"]
    rows, columns = len(ground["height"]) // ground["columns"], ground["columns"]
    north = ground["south"] + ground["cell"] * np.arange(rows)
    east = ground["west"] + ground["cell"] * np.arange(columns)
    true = run.scenario.ground.height(*np.meshgrid(north, east, indexing="ij"))
    np.testing.assert_allclose(np.reshape(ground["height"], (rows, columns)), true, atol=0.6)
    assert true.max() > 75.0
    assert embedded(load_run(make_run(flown_s=20.0)))["ground"] is None


def test_unknown_values_are_null(make_run):
    run = load_run(make_run(flown_s=20.0, truth=False, unseen=slice(50, 60)))
    assert embedded(run)["errors"][-1]["x"]["v"].count(None) == 10


def test_json_cannot_end_its_script():
    text = as_script({"said": "</script><!--\u2028"})
    assert "<" not in text
    assert json.loads(text) == {"said": "</script><!--\u2028"}


def test_cells_are_escaped():
    assert '<td class="text">&lt;i&gt;</td>' in table(["a"], [["<i>"]])


def test_one_broken_expectation_breaks_the_run(make_run):
    summary = load_run(make_run(flown_s=20.0)).summary
    assert "1 of 3 expectations broken" in verdict(summary)
    unbroken = [entry for entry in summary["expect"] if entry["held"] is not False]
    assert "none broken, 1 not judged" in verdict({**summary, "expect": unbroken})
    assert "all held" in verdict({**summary, "expect": unbroken[:1]})
    assert "nothing was judged" in verdict({**summary, "expect": unbroken[1:]})
    late = {**summary["control"], "late_ticks": 289, "ticks": 439, "lateness": "late ticks: 289 of 439 began"}
    assert "all held, 289 of 439 ticks late" in verdict({**summary, "expect": unbroken[:1], "control": late})
    assert "late ticks: 289 of 439 began" in control({"control": late})
    assert "2 safety violations" in verdict({**summary, "safety": {"violations": 2}})
    assert "1 left unsafe" in verdict({**summary, "expect": unbroken, "unsafe": ["vehicle 3 was lost in the air"]})


def test_the_papers_figures_stand_beside_ours_only_after_its_own_disturbance(make_run):
    step = {"at_s": 30, "velocity_mps": [0.6, 0.6, 0.0]}
    run = load_run(make_run(straight(3, 100, disturbances=[step])))
    errors = np.abs(np.concatenate([run.flown.error(v)[run.flown.window(30, 100)] for v in run.followers]))
    cells = re.findall(r"<td>([^<]+)</td>", beside_the_paper(run))
    largest = [f"{value:.3f}" for value in errors.max(axis=0)]
    assert cells[:6] == ["0.22", largest[0], "0.50", largest[1], "–", largest[2]]
    assert cells[6::2] == ["no collision", "no collision"]
    assert cells[7::2] == [f"{run.summary['safety'][f'min_{what}_m']:.1f}" for what in ("separation", "clearance")]
    for other in ({"at_s": 60, "velocity_mps": [0.6, 0.6, 0.0]}, {"at_s": 30, "velocity_mps": [0.3, 0.6, 0.0]}):
        assert beside_the_paper(load_run(make_run(straight(3, 100, disturbances=[other])))) == ""


@pytest.mark.parametrize(
    ("vehicles", "whom"),
    [
        ("all", "every vehicle"),
        ([1, "1:2", 3], "every vehicle"),
        ([2, 3], "followers only, a relative disturbance"),
        ([1, 3], "vehicles 1, 3 only, the leader among them"),
    ],
)
def test_whom_a_step_moves_is_said_as_the_scenario_names_them(make_run, vehicles, whom):
    step = {"at_s": 30, "velocity_mps": [0.6, 0.6, 0.0], "vehicles": vehicles}
    run = load_run(make_run(straight(3, 100, disturbances=[step])))
    assert f"the step acts on {whom}, from 30 s on" in beside_the_paper(run)


def test_a_run_that_never_settled_says_so(make_run):
    text = cards(load_run(make_run(flown_s=3.0)))
    assert "0 of 3" in text
    assert "never within 0.5 m for 10 s" in text


def test_those_that_settled_and_left_are_counted(make_run):
    run = load_run(make_run(flown_s=3.0))
    first, second, _ = run.summary["followers"].values()
    first |= {"settled_at_s": 0.1, "left_at_s": 53.14}
    second |= {"settled_at_s": 0.3, "left_at_s": 60.0}
    assert "the last at 0.3 s; 2 left again, the first at 53.1 s" in cards(run)
