"""Confidence intervals, standard errors and ranges for the figures of the experiments."""

import dataclasses
from collections.abc import Sequence
from math import sqrt

import numpy as np
import numpy.typing as npt
from chefshat.learn.figures import Line

from chefshat_paper.experiments.results import Estimate

# Half the width of a 95% interval of the normal distribution, in standard deviations.
Z_95 = 1.959963984540054


def share(hits: int, of: int, *, digits: int = 1) -> Estimate:
    """Returns a share with Wilson's 95% interval, which is valid for small numbers, too; for `of` 0: 0, from 0 to 1."""
    if not 0 <= hits <= of:
        raise ValueError(f"{hits} of {of}")
    if of == 0:
        return Estimate(0.0, 0.0, 1.0, percent=True, digits=digits)
    p = hits / of
    squared = Z_95 * Z_95
    middle = (p + squared / (2 * of)) / (1 + squared / of)
    half = Z_95 * sqrt(p * (1 - p) / of + squared / (4 * of * of)) / (1 + squared / of)
    # At 0 and 1 the ends are exact, without rounding errors.
    low = 0.0 if hits == 0 else middle - half
    high = 1.0 if hits == of else middle + half
    return Estimate(p, low, high, percent=True, digits=digits)


def mean(values: npt.ArrayLike, *, digits: int = 1) -> Estimate:
    """Returns the mean of independent values with its 95% interval (normal); without an interval for a single value."""
    array = np.asarray(values, dtype=np.float64)
    if array.size == 0:
        raise ValueError("a mean of nothing")
    middle = float(array.mean())
    if array.size == 1:
        return Estimate(middle, digits=digits)
    half = Z_95 * float(array.std(ddof=1)) / sqrt(array.size)
    return Estimate(middle, middle - half, middle + half, digits=digits)


def spread(values: Sequence[float], *, percent: bool = False, digits: int = 1) -> Estimate:
    """Returns the mean over repetitions (seeds), with its standard error, the minimum and the maximum."""
    if not values:
        raise ValueError("a spread of nothing")
    array = np.asarray(values, dtype=np.float64)
    # Rounding may put the mean of equal numbers below them.
    middle = float(np.clip(array.mean(), array.min(), array.max()))
    return Estimate(middle, float(array.min()), float(array.max()), percent=percent, digits=digits, error=standard_error(array))


def clustered(values: Sequence[float], *, percent: bool = False, digits: int = 1) -> Estimate:
    """Returns the mean over games with its standard error. Games are independent; the Shifts of a game need not be."""
    return dataclasses.replace(spread(values, percent=percent, digits=digits), low=None, high=None)


def standard_error(values: npt.ArrayLike) -> float | None:
    """Returns the standard error of the mean of independent values; None for a single value."""
    array = np.asarray(values, dtype=np.float64)
    return float(array.std(ddof=1)) / sqrt(array.size) if array.size > 1 else None


def cluster_ratio(values: npt.ArrayLike) -> float:
    """Returns the standard error of the mean if only clusters are independent, as a multiple of that if all values are.

    Args:
        values: (clusters, values of each), at least two of each, not all equal.
    """
    array = np.asarray(values, dtype=np.float64)
    by_cluster, alone = standard_error(array.mean(axis=1)), standard_error(array)
    if not by_cluster or not alone:
        raise ValueError("the ratio needs two clusters of values that differ")
    return by_cluster / alone


def band(label: str, x: Sequence[float], runs: npt.ArrayLike) -> Line:
    """Returns the mean line of `runs`, (repetitions, len(x)), with a band from minimum to maximum."""
    array = np.asarray(runs, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != len(x):
        raise ValueError(f"runs have the shape {array.shape}, x has {len(x)} values")
    return Line(label, list(x), array.mean(axis=0).tolist(), array.min(axis=0).tolist(), array.max(axis=0).tolist())


def smooth(values: npt.ArrayLike, width: int) -> npt.NDArray[np.float64]:
    """Returns running means along the last axis over the latest `width` values, fewer at the beginning. Keeps the shape."""
    array = np.asarray(values, dtype=np.float64)
    if width < 1:
        raise ValueError("the width must be at least 1")
    sums = np.cumsum(np.concatenate([np.zeros((*array.shape[:-1], 1)), array], axis=-1), axis=-1)
    ends = np.arange(1, array.shape[-1] + 1)
    begins = np.maximum(ends - width, 0)
    means: npt.NDArray[np.float64] = (sums[..., ends] - sums[..., begins]) / (ends - begins)
    return means
