"""What a study's rows say of its expectations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from scipy.stats import beta

from gcs_formation.studies.keys import Wanted
from gcs_formation.studies.plan import Row, keeps


class Verdict(NamedTuple):
    """An expectation and what came of it."""

    wanted: Wanted
    flights: int
    """How many it concerns."""
    kept: int

    @property
    def share(self) -> float | None:
        """The share of the flights that kept the bound."""
        return self.kept / self.flights if self.flights else None

    @property
    def held(self) -> bool:
        """Whether enough did; not where it concerns none."""
        return self.share is not None and self.share >= self.wanted.share

    @property
    def interval(self) -> tuple[float, float]:
        """The confidence interval of the share, by Clopper and Pearson (Biometrika 26, 1934)."""
        return clopper_pearson(self.kept, self.flights, self.wanted.confidence)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of study.json."""
        low, high = self.interval
        said = self.wanted.model_dump(exclude_none=True)
        found = {"flights": self.flights, "kept": self.kept, "found_share": self.share}
        return {**said, **found, "interval": [low, high], "held": self.held}

    def __str__(self) -> str:
        """Return the verdict in words."""
        bounds = {"below": self.wanted.below, "above": self.wanted.above}
        bound = " and ".join(f"{name} {value:g}" for name, value in bounds.items() if value is not None)
        where = "".join(f", {name} = {value}" for name, value in self.wanted.where.items())
        low, high = self.interval
        found = f"{self.kept} of {self.flights} flights{where}"
        sure = f"({self.wanted.confidence:.0%} confidence: {low:.2%} to {high:.2%})"
        state = "held" if self.held else "broken"
        return f"{self.wanted.metric} {bound}: {found} {sure}; expected: {self.wanted.share:.2%} or more: {state}"


def judge(wanted: Wanted, rows: Sequence[Row]) -> Verdict:
    """Return the verdict on the rows that an expectation concerns."""
    concerned = [row for row in rows if _matches(wanted.where, row)]
    return Verdict(wanted, len(concerned), sum(keeps(wanted, row) for row in concerned))


def clopper_pearson(kept: int, flights: int, confidence: float) -> tuple[float, float]:
    """Return the interval in which a binomial share lies with at least this confidence."""
    if flights == 0:
        return 0.0, 1.0
    outside = (1.0 - confidence) / 2.0
    low = float(beta.ppf(outside, kept, flights - kept + 1)) if kept else 0.0
    high = float(beta.ppf(1.0 - outside, kept + 1, flights - kept)) if kept < flights else 1.0
    return low, high


def _matches(where: Mapping[str, Any], row: Row) -> bool:
    return all(row.get(name) == value for name, value in where.items())
