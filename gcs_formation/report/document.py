"""Self-contained HTML pages: the frame that all pages share."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template


def document(title: str, template: str, **parts: str) -> str:
    """Return a whole page. The body's template takes `title` and `parts`, which are HTML already."""
    name = escape(title)
    body = Template(template).substitute(title=name, **parts)
    return Template(asset("page.html")).substitute(title=name, style=asset("report.css"), body=body)


def asset(name: str) -> str:
    """Return the text of a file that pages are made of."""
    return (files("gcs_formation.report") / "assets" / name).read_text(encoding="utf-8")


def figure(name: str, title: str, caption: str, path: Path) -> str:
    """Return a picture with its caption, its file embedded."""
    image = b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure id="figure-{name}"><img alt="{escape(title)}" src="data:image/png;base64,{image}">'
        f"<figcaption><b>{escape(title)}.</b> {escape(caption)}</figcaption></figure>\n"
    )
