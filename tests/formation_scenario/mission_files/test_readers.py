"""Mission files of other programs: what each format says, and which words refuse what it can't."""

import json
import math
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavwp

from formation_scenario.mission_files import MissionFileError, read_mission
from formation_scenario.mission_files.formats import FORMATS
from formation_scenario.mission_files.mission import FenceCircle, FencePolygon
from formation_scenario.mission_files.structure_scan import offset

WAYPOINTS = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584.08\t1
1\t0\t3\t22\t15\t0\t0\t0\t-35.361\t149.165\t60\t1
2\t0\t3\t16\t0\t5\t0\t0\t-35.359\t149.1612\t100.5\t1
# a comment, as pymavlink allows
3\t0\t10\t18\t2\t0\t-90\t1\t-35.366\t149.1642\t110\t1
4\t0\t0\t178\t0\t18\t-1\t0\t0\t0\t0\t1
5\t0\t3\t177\t2\t1\t0\t0\t0\t0\t0\t1
6\t0\t0\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""


def simple(command, frame, *params, number=1):
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": list(params), "doJumpId": number}


def plan(*items, **parts):
    mission = {"items": list(items), "plannedHomePosition": [47.0, 8.0, 488.0], "cruiseSpeed": 15, "version": 2}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission, **parts})


def read(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read_mission(path)


def test_a_waypoint_file_says_what_pymavlink_reads_of_it(tmp_path):
    mission = read(tmp_path, "tour.waypoints", WAYPOINTS)
    peer = mavwp.MAVWPLoader()
    peer.load(str(tmp_path / "tour.waypoints"))
    home, *theirs = [peer.wp(index) for index in range(peer.count())]
    assert mission.home == (home.x, home.y, home.z)
    for ours, one in zip(mission.items, theirs, strict=True):
        assert (ours.command, ours.frame) == (one.command, one.frame)
        assert ours.params == (one.param1, one.param2, one.param3, one.param4)
        assert (ours.lat_deg, ours.lon_deg, ours.height_m) == (one.x, one.y, one.z)


def test_a_plan_gives_items_home_fence_and_rally(tmp_path):
    fence = {
        "circles": [{"circle": {"center": [47.0, 8.0], "radius": 900.0}, "inclusion": True}],
        "polygons": [{"polygon": [[47.0, 8.0], [47.01, 8.0], [47.01, 8.01]], "inclusion": False}],
    }
    text = plan(
        simple(22, 3, 15, 0, 0, None, 47.0, 8.0, 50),
        simple(16, 3, 0, 0, 0, None, 47.01, 8.0, 100, number=2),
        simple(206, 2, 25, 0, 1, 0, 0, 0, 0, number=3),
        geoFence=fence,
        rallyPoints={"points": [[47.0, 8.001, 60]]},
    )
    mission = read(tmp_path, "tour.plan", text)
    assert mission.home == (47.0, 8.0, 488.0)
    assert [item.command for item in mission.items] == [22, 16, 206]
    assert mission.jump_targets == (1, 2, 3)
    assert math.isnan(mission.items[0].params[3]), "null is left open"
    assert [item.placed for item in mission.items] == [True, True, False]
    corners = ((47.0, 8.0), (47.01, 8.0), (47.01, 8.01))
    assert mission.fence.areas == (FenceCircle((47.0, 8.0), 900.0, True), FencePolygon(corners, False))
    assert mission.fence.rally == ((47.0, 8.001, 60.0),)


def test_surveys_are_flown_by_the_items_that_qgroundcontrol_made_of_them(tmp_path):
    lanes = [simple(16, 3, 0, 0, 0, None, 47.0 + index / 1000, 8.0, 80, number=10 + index) for index in range(4)]
    survey = {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": lanes}}
    mission = read(tmp_path, "survey.plan", plan(survey))
    assert [item.lat_deg for item in mission.items] == [47.0, 47.001, 47.002, 47.003]
    assert mission.jump_targets == (10, 11, 12, 13)


def test_a_survey_without_items_is_flown_by_its_turning_points(tmp_path):
    transects = {
        "VisualTransectPoints": [[47.0, 8.0], [47.01, 8.0]],
        "CameraCalc": {"DistanceToSurface": 55},
        "Items": [],
    }
    survey = {"type": "ComplexItem", "complexItemType": "CorridorScan", "TransectStyleComplexItem": transects}
    mission = read(tmp_path, "corridor.plan", plan(survey))
    assert [(item.lat_deg, item.height_m, item.frame) for item in mission.items] == [(47.0, 55.0, 3), (47.01, 55.0, 3)]


def scan(**keys):
    square = [[47.0, 8.0], [47.0, 8.001], [47.001, 8.001], [47.001, 8.0]]
    return {
        "type": "ComplexItem", "complexItemType": "StructureScan", "polygon": square, "Layers": 2,
        "CameraCalc": {"DistanceToSurface": 30, "AdjustedFootprintFrontal": 10}, "EntranceAltitude": 60,
        "ScanBottomAlt": 5, "StructureHeight": 25, "StartFromTop": False, **keys,
    }  # fmt: skip


def test_a_structure_scan_circles_its_layers_half_a_footprint_inside_from_the_bottom_or_the_top(tmp_path):
    for top, heights in ((False, [10.0, 20.0]), (True, [20.0, 10.0])):
        mission = read(tmp_path, "scan.plan", plan(scan(StartFromTop=top)))
        found = [item.height_m for item in mission.items]
        assert found == [60.0, *[heights[0]] * 5, *[heights[1]] * 5, 60.0]


@given(st.lists(st.floats(0.6, 1.2), min_size=3, max_size=8), st.floats(1.0, 50.0), st.booleans())
def test_a_convex_polygon_is_offset_by_the_distance_on_every_wall(steps, distance_m, clockwise):
    turned_rad, corners = 0.0, []
    for step in steps:  # corners on an ellipse are convex; from north by east, so clockwise
        turned_rad += 2.0 * math.pi * step / sum(steps)
        corners.append((47.0 + 0.004 * math.cos(turned_rad), 8.0 + 0.006 * math.sin(turned_rad)))
    corners = corners if clockwise else corners[::-1]

    def flat(points):
        return [(111_166.0 * (lat - 47.0), 76_055.0 * (lon - 8.0)) for lat, lon in points]

    walls, moved = flat(corners), flat(offset(corners, distance_m, "scan"))
    for index, (north, east) in enumerate(walls):
        after = (index + 1) % len(walls)
        along = (walls[after][0] - north, walls[after][1] - east)
        for corner in (moved[index], moved[after]):
            right = (along[0] * (corner[1] - east) - along[1] * (corner[0] - north)) / math.hypot(*along)
            assert (-right if clockwise else right) == pytest.approx(distance_m, rel=0.02)


KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><LineString>
<altitudeMode>{mode}</altitudeMode><coordinates>8.0,47.0,100 8.01,47.0,120
8.01,47.01,120</coordinates></LineString></Placemark></Document></kml>"""


@pytest.mark.parametrize(("mode", "datum"), [("absolute", "sea level"), ("relativeToGround", "ground")])
def test_a_kml_line_is_longitude_latitude_and_a_height_as_its_mode_says(tmp_path, mode, datum):
    mission = read(tmp_path, "line.kml", KML.format(mode=mode))
    first = mission.items[0]
    assert (first.lat_deg, first.lon_deg, first.height_m, first.datum) == (47.0, 8.0, 100.0, datum)
    assert len(mission.items) == 3


def test_a_kml_line_on_the_ground_has_no_heights(tmp_path):
    mission = read(tmp_path, "line.kml", KML.format(mode="clampToGround"))
    assert all(math.isnan(item.height_m) for item in mission.items)


def gpx(kind, inner, count=3):
    points = "".join(f'<{inner} lat="{47 + i / 100}" lon="8.0"><ele>{500 + i}</ele></{inner}>' for i in range(count))
    body = f"<{kind}>{points}</{kind}>" if kind else points
    body = body.replace("<trk>", "<trk><trkseg>").replace("</trk>", "</trkseg></trk>")
    return f'<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1">{body}</gpx>'


@pytest.mark.parametrize(
    ("kind", "inner", "track"), [("rte", "rtept", False), ("trk", "trkpt", True), ("", "wpt", False)]
)
def test_a_gpx_gives_its_route_or_track_with_heights_above_sea_level(tmp_path, kind, inner, track):
    mission = read(tmp_path, "tour.gpx", gpx(kind, inner))
    assert [(item.lat_deg, item.height_m) for item in mission.items] == [(47.0, 500.0), (47.01, 501.0), (47.02, 502.0)]
    assert mission.items[0].datum == "sea level"
    assert mission.track is track


def test_a_geojson_line_is_longitude_first(tmp_path):
    line = {"type": "LineString", "coordinates": [[8.0, 47.0, 520], [8.01, 47.0, 530]]}
    collection = {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": line}]}
    mission = read(tmp_path, "line.geojson", json.dumps(collection))
    assert [(item.lat_deg, item.lon_deg, item.height_m) for item in mission.items] == [
        (47.0, 8.0, 520.0),
        (47.0, 8.01, 530.0),
    ]


@pytest.mark.parametrize(("column", "datum"), [("alt_m", "sea level"), ("height_m", "home"), ("AGL", "ground")])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_names_its_columns_in_any_order(tmp_path, column, datum, separator):
    rows = [["name", column, "Lon", "Latitude"], ["a", "90", "8.0", "47.0"], ["b", "95.5", "8.01", "47.0"]]
    mission = read(tmp_path, "tour.csv", "\n".join(separator.join(row) for row in rows))
    assert [(item.lat_deg, item.lon_deg, item.height_m) for item in mission.items] == [
        (47.0, 8.0, 90.0),
        (47.0, 8.01, 95.5),
    ]
    assert mission.items[0].datum == datum


REFUSED = [
    ("a.waypoints", "QGC WPL 110\n1\t0\t3\t16\t0\t0\n", "line 2: found 6 columns; allowed: 12"),
    ("a.waypoints", "hello", "line 1: found 'hello'; allowed: 'QGC WPL 110'"),
    ("a.waypoints", WAYPOINTS.replace("100.5", "high"), "item 2: found 'high' as its column 11; allowed: a number"),
    ("a.plan", "{}", "no plan"),
    ("a.plan", "{", "not JSON"),
    ("a.plan", plan(simple(16, 3, 0, 0, 0)), "item 1: found 3 params; allowed: 7"),
    ("a.plan", plan({"type": "ComplexItem", "complexItemType": "teapot"}), "found a complex item 'teapot'"),
    ("a.plan", plan(scan(Layers=10**6)), "found 1000000 layers"),
    ("a.plan", plan(scan(polygon=[[47.0, 8.0]] * 3)), "has no area"),
    ("a.kml", "<kml/>", "nothing to fly"),
    ("a.kml", KML.format(mode="absolute").replace("8.01,47.0,120", "8.01,97.0,120"), "found latitude 97"),
    ("a.kml", "<gpx/>", "found <gpx>"),
    ("a.gpx", gpx("rte", "rtept", 1), "nothing to fly"),
    ("a.gpx", gpx("rte", "rtept").replace("500", "x"), "rtept 1: found 'x' as its height"),
    ("a.gpx", '<!DOCTYPE a [<!ENTITY b "bb">]><gpx>&b;</gpx>', "found a document type"),
    ("a.geojson", '{"type": "Point", "coordinates": [8, 47]}', "nothing to fly"),
    ("a.geojson", '{"type": "LineString", "coordinates": [[8, 47], 5]}', "position 2: found 5"),
    ("a.csv", "lat,height\n1,2\n3,4\n", "one of lon_deg"),
    ("a.csv", "lat,lon\n1,2\n3,4,5\n", "line 3: found 3 columns; allowed: 2"),
    ("a.csv", "lat,lon\n1,2\n", "found 1 points; allowed: 2 to 20000"),
    ("a.shp", "x", "found a file '.shp'; allowed: .plan, .waypoints"),
]


@pytest.mark.parametrize(("name", "text", "words"), REFUSED)
def test_what_cannot_be_read_is_named_with_its_position_and_what_is_allowed(tmp_path, name, text, words):
    with pytest.raises(MissionFileError) as refused:
        read(tmp_path, name, text)
    assert words in str(refused.value)
    assert name in str(refused.value)


def test_a_file_that_is_missing_or_not_text_is_refused(tmp_path):
    with pytest.raises(MissionFileError, match="No such file"):
        read_mission(tmp_path / "none.plan")
    (tmp_path / "binary.gpx").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MissionFileError, match="0xff at offset 0"):
        read_mission(tmp_path / "binary.gpx")


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-400, 400) | st.floats(allow_nan=True) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(
        st.sampled_from(["type", "mission", "items", "params", "frame", "command", "polygon", "coordinates", "geometry",
                         "geoFence", "circles", "features", "TransectStyleComplexItem", "complexItemType"]),
        inner, max_size=4),
    max_leaves=20,
)  # fmt: skip


@given(st.sampled_from(sorted(FORMATS)), st.text(max_size=60) | json_values.map(json.dumps))
def test_no_text_ends_in_another_error(suffix, text):
    with suppress(MissionFileError):
        FORMATS[suffix](text, "file")


@given(json_values)
def test_no_plan_ends_in_another_error(inner):
    for key in ("mission", "geoFence", "rallyPoints"):
        text = json.dumps({"fileType": "Plan", "mission": {"items": []}, key: inner})
        with suppress(MissionFileError):
            FORMATS[".plan"](text, "file")


def test_the_first_line_that_can_be_flown_is_and_the_others_are_named(tmp_path):
    line = "<LineString><altitudeMode>absolute</altitudeMode><coordinates>{}</coordinates></LineString>"
    lines = "".join(line.format(each) for each in ("8.5,47.4,500", "8.5,47.4,500 8.6,47.4,500", "8,47,1 9,47,1"))
    mission = read(tmp_path, "tour.kml", f"<kml><Document>{lines}</Document></kml>")
    assert [item.lon_deg for item in mission.items] == [8.5, 8.6]
    assert mission.remarks == ("tour.kml: 2 other lines not flown",)
    features = [{"type": "LineString", "coordinates": each} for each in ([[8, 47]], [[8, 47, 5], [9, 47, 5]])]
    geojson = json.dumps({"type": "GeometryCollection", "geometries": features})
    assert len(read(tmp_path, "tour.geojson", geojson).items) == 2


def test_survey_items_without_a_height_have_that_of_the_survey(tmp_path):
    items = [
        {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, 47.4, lon, None]} for lon in (8, 9)
    ]
    survey = {"CameraCalc": {"DistanceToSurface": 60}, "Items": items}
    entry = {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": survey}
    text = json.dumps({"fileType": "Plan", "mission": {"items": [entry]}})
    assert [item.height_m for item in read(tmp_path, "tour.plan", text).items] == [60.0, 60.0]
