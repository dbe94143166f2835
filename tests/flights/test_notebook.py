"""Flights in notebooks: the example's code runs, and what it shows can be shown."""

from __future__ import annotations

import ast
import json
import re
import shutil
import sys
from io import BytesIO
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from PIL import Image

import gcs_formation
from gcs_formation.notebook import FlightFigure, Picture
from tests.flights.conftest import scenario

EXAMPLES = Path(__file__).parents[2] / "examples"


def run_cells(file: Path) -> list[Any]:
    """Run a notebook's code in one namespace; return what each cell ends with, None for a statement."""
    names: dict[str, Any] = {}
    shown = list[Any]()
    for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            body = ast.parse("".join(cell["source"]), str(file))
            last = body.body.pop() if isinstance(body.body[-1], ast.Expr) else None
            exec(compile(body, str(file), "exec"), names)
            value = ast.Expression(last.value) if isinstance(last, ast.Expr) else None
            shown.append(None if value is None else eval(compile(value, str(file), "eval"), names))
    return shown


def is_png(content: bytes) -> bool:
    with Image.open(BytesIO(content)) as image:
        return image.format == "PNG" and min(image.size) > 200


@pytest.mark.slow
def test_the_example_notebook_runs_and_shows_a_table_a_figure_and_margins(tmp_path, monkeypatch):
    shutil.copy(EXAMPLES / "diamond.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    _, summary, figure, margins = run_cells(EXAMPLES / "flight.ipynb")
    html = summary._repr_html_()
    assert html.count("<tr>") == 4, "a head, and three followers"
    assert re.search(r"<th>follower</th>.*<td>2</td>", html, re.DOTALL)
    assert is_png(figure._repr_png_())
    assert is_png(figure.save(tmp_path / "errors.png").read_bytes())
    assert set(margins) == set("xyz")
    with pytest.raises(ValueError, match=r"found 'error'; allowed: errors, trajectory, plan"):
        summary.figure("error")


def test_a_figure_follows_a_flight(tmp_path):
    shown = list[bytes]()
    figure = FlightFigure(lambda _: shown.append(figure._repr_png_()))
    with gcs_formation.Flight(scenario(duration_s=2, vehicles={"count": 3}), out=tmp_path / "run") as flight:
        ticks = list(figure.follow(flight, every_s=10.0))
    flown_s = ticks[-1].time_s - ticks[0].time_s
    assert len(shown) == int(flown_s / 10.0) + 2, "every 10 s, and at the end"
    assert all(map(is_png, shown))
    assert len(set(shown)) > 1
    plan, errors = figure.picture().figure.axes
    assert [line.get_label() for line in plan.get_lines()[::2]] == ["1", "2", "3"]
    assert [line.get_label() for line in errors.get_lines()] == ["2", "3"]
    north_m: Any = plan.get_lines()[0].get_ydata()
    assert north_m[-1] == ticks[-1].vehicles[1].state.north_m


class Handle:
    def __init__(self, shown: object) -> None:
        self.shown = [shown]

    def update(self, shown: object) -> None:
        self.shown.append(shown)


def test_in_a_notebook_it_is_drawn_in_place_and_elsewhere_not_at_all(monkeypatch):
    ticks = [SimpleNamespace(time_s=float(i), phase="flying", vehicles={}) for i in range(4)]
    figure, handles = FlightFigure(), list[Handle]()
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert list(figure.follow(ticks, every_s=1.0)) == ticks
    python: Any = ModuleType("IPython")
    display: Any = ModuleType("IPython.display")
    python.get_ipython = object
    display.display = lambda shown, display_id: handles.append(Handle(shown)) or handles[-1]
    monkeypatch.setitem(sys.modules, "IPython", python)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    assert list(figure.follow(ticks, every_s=2.0)) == ticks
    (handle,) = handles
    assert handle.shown == [figure] * 3
    assert isinstance(figure.picture(), Picture)
