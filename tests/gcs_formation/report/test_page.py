import base64
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from formation_scenario import load_scenario
from gcs_formation.report import load_run
from gcs_formation.report.page import PLATES, as_script, embedded
from gcs_formation.report.page_parts import cards, compared_with_paper, control, table, verdict

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
    return json.loads(text.partition('id="recording">')[2].partition("</script>")[0])


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
    unscripted = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"https?://|@import|url\(", unscripted)
    assert "default-src 'none'; img-src data:;" in text  # so that no script can fetch anything either


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


def ticks_of(data):
    """Return the times (K,) and the values (K, vehicles, columns) that a page holds."""
    ticks = base64.b64decode(data["ticks"])
    length = int.from_bytes(ticks[:4], "little")
    head = json.loads(ticks[4 : 4 + length])
    three = np.frombuffer(ticks, "<f8", 3 * head["count"], 4 + length).reshape(-1, 3)
    values = np.frombuffer(ticks, "<f4", offset=4 + length + three.nbytes)
    return three[:, 0], values.reshape(head["count"], head["vehicles"], head["columns"])


def test_embedded_ticks_are_recorded_ones_with_the_largest_errors(report):
    _, run, text = report
    data = data_of(text)
    time_s, values = ticks_of(data)
    at = np.searchsorted(run.whole.common["t_s"], time_s)
    column = data["meta"]["columns"].index
    assert data["meta"]["vehicles"] == [str(vehicle) for vehicle in run.whole.vehicles]
    largest = 0.0
    for place, vehicle in enumerate(run.whole.vehicles):
        first = column("north_m")
        np.testing.assert_allclose(
            values[:, place, first : first + 3], run.whole.position(vehicle)[at], rtol=1e-6, atol=1e-3
        )
        if vehicle in run.followers:
            first, recorded = column("error_x_m"), run.whole.error(vehicle)
            np.testing.assert_allclose(values[:, place, first : first + 3], recorded[at], rtol=1e-5, atol=1e-5)
            largest = max(largest, float(np.nanmax(np.abs(recorded))))
    shown = values[:, :, column("error_x_m") : column("error_z_m") + 1]
    assert float(np.nanmax(np.abs(shown))) == pytest.approx(largest, rel=1e-5)


@pytest.mark.slow
def test_a_hundred_vehicles_fit_in_2_megabytes(make_run):
    scenario = straight(100, 150, formation={"shape": "triangle"})
    data = embedded(load_run(make_run(scenario)))
    assert len(as_script(data).encode()) < 2_000_000
    assert ticks_of(data)[1].shape[1] == 100


def test_the_embedded_ground_is_the_scenarios(make_run):
    hill = {"north_m": 900, "east_m": 200, "height_m": 80, "radius_m": 300}
    run = load_run(make_run(straight(3, 60, terrain={"hills": [hill], "clearance_m": 10})))
    ground = embedded(run)["meta"]["scene"]["ground"]
    rows, columns = len(ground["height"]) // ground["columns"], ground["columns"]
    north = ground["south"] + ground["cell"] * np.arange(rows)
    east = ground["west"] + ground["cell"] * np.arange(columns)
    true = run.scenario.ground.height(*np.meshgrid(north, east, indexing="ij"))
    np.testing.assert_allclose(np.reshape(ground["height"], (rows, columns)), true, atol=0.6)
    assert true.max() > 75.0
    assert embedded(load_run(make_run(flown_s=20.0)))["meta"]["scene"]["ground"] is None


def test_unknown_values_stay_unknown(make_run):
    run = load_run(make_run(flown_s=20.0, truth=False, unseen=slice(50, 60)))
    data = embedded(run)
    column = data["meta"]["columns"].index("error_x_m")
    assert np.isnan(ticks_of(data)[1][:, -1, column]).sum() == 10


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
    cells = re.findall(r"<td>([^<]+)</td>", compared_with_paper(run))
    largest = [f"{value:.3f}" for value in errors.max(axis=0)]
    assert cells[:6] == ["0.22", largest[0], "0.50", largest[1], "–", largest[2]]
    assert cells[6::2] == ["no collision", "no collision"]
    assert cells[7::2] == [f"{run.summary['safety'][f'min_{what}_m']:.1f}" for what in ("separation", "clearance")]
    for other in ({"at_s": 60, "velocity_mps": [0.6, 0.6, 0.0]}, {"at_s": 30, "velocity_mps": [0.3, 0.6, 0.0]}):
        assert compared_with_paper(load_run(make_run(straight(3, 100, disturbances=[other])))) == ""


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
    assert f"the step acts on {whom}, from 30 s on" in compared_with_paper(run)


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
