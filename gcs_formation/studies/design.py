"""From a study's parameters to its samples: one value for each parameter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TypeAlias

import numpy as np
from scipy.stats import norm, qmc

from airlink.random_streams import random_stream
from formation_scenario.arrays import Array
from gcs_formation.studies.keys import Distribution, LogUniform, Normal, Parameter, Range, Study, Uniform, Value

Sample: TypeAlias = Mapping[str, Value]
INSIDE = 1e-12
"""Least distance of a share from 0 and 1, where a normal distribution has no value."""


def count_samples(study: Study) -> int:
    """Return how many samples a study has, without making them."""
    sizes = [len(levels) for each in study.parameters.values() if (levels := _levels(each)) is not None]
    match study.design:
        case "grid":
            return math.prod(sizes)
        case "one_at_a_time":
            return 1 + sum(size - 1 for size in sizes)
        case _:
            return study.samples


def samples(study: Study) -> list[Sample]:
    """Return the samples in order. A parameter with a distribution is missing where each flight draws its own."""
    names = list(study.parameters)
    match study.design:
        case "grid":
            listed = {name: levels for name in names if (levels := _levels(study.parameters[name])) is not None}
            return [dict(zip(listed, values, strict=True)) for values in product(*listed.values())]
        case "one_at_a_time":
            return _one_at_a_time(study)
        case _:
            return [
                {name: at(study.parameters[name], float(share)) for name, share in zip(names, row, strict=True)}
                for row in _shares(study, len(names))
            ]


def drawn(study: Study, flight: int) -> Sample:
    """Return the values that a flight draws by itself: those of distributions in designs of lists."""
    if study.design not in {"grid", "one_at_a_time"}:
        return {}
    open_ones = {name: each for name, each in study.parameters.items() if _levels(each) is None}
    random = np.random.Generator(np.random.Philox(random_stream(study.seeds.first, "study", flight)))
    return {name: at(each, float(random.random())) for name, each in open_ones.items()}


def at(parameter: Parameter, share: float) -> Value:
    """Return a parameter's value at a share from 0 to 1 of its distribution, or of its list."""
    match parameter:
        case Uniform(uniform=(low, high)):
            return low + (high - low) * share
        case LogUniform(log_uniform=(low, high)):
            return low * (high / low) ** share
        case Normal(normal=(mean, sigma)):
            return mean + sigma * float(norm.ppf(min(max(share, INSIDE), 1.0 - INSIDE)))
        case _:
            levels = _levels(parameter) or [None]
            return levels[min(int(share * len(levels)), len(levels) - 1)]


def _levels(parameter: Parameter) -> Sequence[Value] | None:
    """Return a parameter's values, None for a distribution."""
    match parameter:
        case Range(range=(first, last, count)):
            return np.linspace(first, last, count).tolist()
        case list():
            return parameter
        case _:
            return None


def _one_at_a_time(study: Study) -> list[Sample]:
    listed = {name: levels for name, each in study.parameters.items() if (levels := _levels(each)) is not None}
    first = {name: levels[0] for name, levels in listed.items()}
    return [first, *({**first, name: value} for name, levels in listed.items() for value in levels[1:])]


def _shares(study: Study, dimensions: int) -> Array:
    """Return (samples, dimensions) points of the unit cube."""
    count, random = study.samples, np.random.Generator(np.random.Philox(random_stream(study.seeds.first, "design")))
    if dimensions == 0:
        return np.zeros((count, 0))
    match study.design:
        case "latin_hypercube":
            return qmc.LatinHypercube(dimensions, rng=random).random(count)
        case "sobol":
            # The first 2^m points are balanced; a study of another size takes a part of them.
            return qmc.Sobol(dimensions, rng=random).random_base2(max(0, math.ceil(math.log2(count))))[:count]
        case _:
            return random.random((count, dimensions))


__all__ = ["Distribution", "Sample", "at", "count_samples", "drawn", "samples"]
