"""A study's directory: a journal of rows as flights end, and the tables made from it.

The journal is appended to and flushed, so that an interrupted study loses no finished flight. The table is written to a
new file that then replaces the old one.
"""

from __future__ import annotations

import errno
import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from pydantic import ValidationError

from airlink.cli.output_directory import refusal
from airlink.host_system import lock
from formation_scenario.bounded_read import require_file
from formation_scenario.source import Dumper, Plain
from gcs_formation.errors import RecordError, RecordingError
from gcs_formation.record.json_shape import ANYTHING, INTEGER, NUMBER, NUMBER_OR_NULL, OBJECT, TEXT, Shape, mismatch
from gcs_formation.record.run_directory import FIGURES, REPORT
from gcs_formation.studies import Study
from gcs_formation.studies.flight import VERSION
from gcs_formation.studies.plan import is_number

STUDY, JOURNAL, TABLE = "study.yaml", "flights.jsonl", "flights.parquet"
RESULT, TABLE_TEXT = "study.json", "table.md"
CONTENTS = "contents"
"""Key of study.yaml: the hash of each file and extension that the flights used."""
FLIGHTS, AGAIN = "flights", "again"
"""Directories of records of flights, and of flights flown again."""
ROW: Mapping[str, Shape] = {
    **dict.fromkeys(("flight", "seed", "exit"), INTEGER),
    **dict.fromkeys(("wall_s", "cpu_s"), NUMBER_OR_NULL),
    **dict.fromkeys(("version", "words"), TEXT),
}
"""Columns of a flight's row besides parameters and metrics."""


class Dataset:
    """The rows of a study on disk."""

    def __init__(self, path: Path, study: Study, base: Mapping[Any, Plain], *, resume: bool, overwrite: bool) -> None:
        """Open a study's directory; RecordError: it may not or can't be written, RecordingError: the disk is full."""
        self.path, self.study = path, study
        keys = study.model_dump(mode="json", by_alias=True, exclude_none=True)
        plan = {"study": keys, "base": dict(base), "version": VERSION} | _contents(study)
        try:
            if resume:
                self._check_same(plan)
            elif (refused := refusal(path, overwrite=overwrite or not any(read_journal(path)), mark=STUDY)) is not None:
                raise RecordError(f"{refused}; or --resume, which flies what a study lacks")
            else:
                path.mkdir(parents=True, exist_ok=True)
            self._journal = (path / JOURNAL).open("ab", buffering=0)
            lock(self._journal)
            if not resume:
                self._journal.truncate(0)
                _clear(path)
                (path / STUDY).write_text(_text(plan), encoding="utf-8")
            self.rows = self._read()
            self._end_torn_line()
        except BlockingIOError as error:
            found = f"found another study that is being flown into {path}"
            raise RecordError(f"{found}; allowed: a directory of its own") from error
        except OSError as error:
            full = error.errno in {errno.ENOSPC, errno.EDQUOT}
            raise (RecordingError if full else RecordError)(
                f"cannot write the study's directory {path}: {error.strerror or error}"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._journal.close()

    def add(self, row: Mapping[str, Any]) -> None:
        """Add a flight's row, unless it is there already.

        Raises:
            RecordingError: it can't be written; those before are kept.
        """
        if int(row["flight"]) in self.rows:
            return
        try:
            self._append(json.dumps(row, ensure_ascii=False, allow_nan=False) + "\n")
        except OSError as error:
            raise RecordingError(f"cannot go on writing to {self.path}: {error.strerror or error}") from error
        self.rows[int(row["flight"])] = dict(row)

    def write_table(self) -> pa.Table:
        """Write flights.parquet, in the flights' order; return it.

        Raises:
            RecordingError: it can't be written.
        """
        made = table(self.study, [self.rows[flight] for flight in sorted(self.rows)])
        fresh = self.path / f"{TABLE}.new"
        try:
            pq.write_table(made, fresh)
            fresh.replace(self.path / TABLE)
        except OSError as error:
            fresh.unlink(missing_ok=True)
            raise RecordingError(f"cannot write {self.path / TABLE}: {error.strerror or error}") from error
        return made

    def _check_same(self, plan: Mapping[str, Any]) -> None:
        before = read_plan(self.path)
        where = {"study": "the study file", "base": "its scenario", "version": f"the version, now {VERSION}"}
        changed = [text for part, text in where.items() if _text(before[part]) != _text(plan[part])]
        files: Mapping[str, str] = before.get(CONTENTS, {})
        changed += [name for name, digest in plan.get(CONTENTS, {}).items() if files.get(name, digest) != digest]
        if changed:
            found = f"found another study in {self.path}: {' and '.join(changed)} changed"
            raise RecordError(f"{found}; allowed with --resume: the same; else another directory, or --overwrite")

    def _read(self) -> dict[int, dict[str, Any]]:
        try:
            return {row["flight"]: row for row in read_rows(self.path, self.study)}
        except RecordError:
            self._journal.close()
            raise

    def _end_torn_line(self) -> None:
        """End a line that was cut off, so that the next row begins on a new line."""
        written = (self.path / JOURNAL).read_bytes()
        if written and not written.endswith(b"\n"):
            self._append("\n")

    def _append(self, text: str) -> None:
        """Append a text unbuffered. If the disk is full, this raises, and no rest stays in a buffer."""
        left = text.encode()
        while left:
            left = left[self._journal.write(left) :]


def _contents(study: Study) -> dict[str, Mapping[str, str]]:
    """Return the hash of each file that the flights read, and of each extension; nothing without any.

    Raises:
        OSError: a file can't be read any more.
    """
    found = {each.file: each.sha256 for each in study.registered.origins}
    for name in study.files:
        with name.open("rb") as file:
            found[str(name)] = hashlib.file_digest(file, "sha256").hexdigest()
    return {CONTENTS: found} if found else {}


def _clear(path: Path) -> None:
    """Remove what an earlier study, its repeated flights and its report have left."""
    left = (TABLE, RESULT, TABLE_TEXT, REPORT)
    for stale in (*(path / name for name in left), *(path / FIGURES).glob("*.png")):
        stale.unlink(missing_ok=True)
    for records in (path / FLIGHTS, path / AGAIN):
        if records.is_dir():
            shutil.rmtree(records)


def read_plan(path: Path) -> dict[str, Any]:
    """Return study, scenario and version from a study's directory.

    Raises:
        RecordError: it isn't the directory of a study.
    """
    try:
        require_file(path / STUDY)
        plan: Any = yaml.safe_load((path / STUDY).read_text(encoding="utf-8"))
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise RecordError(f"found no study in {path}; expected: a directory that `study --out` wrote") from error
    text = mismatch(plan, {"study": OBJECT, "base": OBJECT, "version": TEXT}, str(path / STUDY))
    if text is not None:
        raise RecordError(text)
    return plan


def read_study(path: Path) -> Study:
    """Return the study of a study's directory.

    Raises:
        RecordError: it isn't the directory of a study, or another version wrote it.
    """
    try:
        return Study.model_validate(read_plan(path)["study"])
    except ValidationError as error:
        keys = ", ".join(dict.fromkeys(".".join(map(str, each["loc"])) for each in error.errors()))
        raise RecordError(f"found a study with wrong keys ({keys}) in {path / STUDY}; expected: as written") from error


def read_rows(path: Path, study: Study) -> list[dict[str, Any]]:
    """Return the rows of a study's directory, except one that was cut off.

    Raises:
        RecordError: a row doesn't belong to that study.
    """
    shape = {**ROW, **dict.fromkeys(study.measured, NUMBER_OR_NULL), **dict.fromkeys(study.columns, ANYTHING)}
    if study.bisect is not None:
        shape[study.bisect.parameter] = NUMBER
    rows = list(read_journal(path))
    for row in rows:
        text = mismatch(row, shape, f"{path / JOURNAL}, flight {row['flight']}")
        if text is not None:
            raise RecordError(text)
    return rows


def read_journal(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of a study's directory, except one that was cut off."""
    if not (path / JOURNAL).is_file():
        return
    for line in (path / JOURNAL).read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            row: Any = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(row, dict) and "flight" in row:
            yield row


def table(study: Study, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows as a table; parameters that aren't numbers are text, in YAML."""
    kinds: dict[str, pa.DataType] = {"flight": pa.int64(), "seed": pa.int64()}
    kinds |= dict.fromkeys(study.measured, pa.float64())
    kinds |= {"exit": pa.int64(), "wall_s": pa.float64(), "cpu_s": pa.float64()}
    kinds |= {"version": pa.string(), "words": pa.string()}
    columns = {name: pa.array([row[name] for row in rows], kind) for name, kind in kinds.items()}
    head = {name: columns.pop(name) for name in ("flight", "seed")}
    return pa.table({**head, **{name: _column(name, rows) for name in study.columns}, **columns})


def _column(name: str, rows: Sequence[Mapping[str, Any]]) -> Any:  # noqa: ANN401 - an array of pyarrow
    values = [row.get(name) for row in rows]
    if all(value is None or isinstance(value, bool) for value in values):
        return pa.array(values, pa.bool_())
    if all(value is None or is_number(value) for value in values):
        return pa.array(values, pa.float64())
    return pa.array([value if isinstance(value, str) else _inline(value) for value in values], pa.string())


def _inline(value: object) -> str:
    return yaml.dump(value, Dumper=Dumper, default_flow_style=True, width=10**6).removesuffix("\n...\n").strip()


def _text(plan: object) -> str:
    return yaml.dump(json.loads(json.dumps(plan)), Dumper=Dumper, sort_keys=False, allow_unicode=True)
