"""Intervals and spreads. Which of them belongs to which figure is decided by the experiments."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
import numpy.typing as npt

from chefshat.experiments.results import Estimate, Line

# Half the width of a 95% interval of the normal distribution, in standard deviations.
Z_95 = 1.959963984540054


def share(hits: int, of: int, *, digits: int = 1) -> Estimate:
    """A share with its 95% interval after Wilson, which holds for small numbers, too. Of nothing: 0, from 0 to 1."""
    if not 0 <= hits <= of:
        raise ValueError(f"{hits} of {of}")
    if of == 0:
        return Estimate(0.0, 0.0, 1.0, percent=True, digits=digits)
    p = hits / of
    squared = Z_95 * Z_95
    middle = (p + squared / (2 * of)) / (1 + squared / of)
    half = Z_95 * sqrt(p * (1 - p) / of + squared / (4 * of * of)) / (1 + squared / of)
    # At 0 and 1 the ends are exact, whatever rounding makes of them.
    low = 0.0 if hits == 0 else middle - half
    high = 1.0 if hits == of else middle + half
    return Estimate(p, low, high, percent=True, digits=digits)


def mean(values: npt.ArrayLike, *, digits: int = 1) -> Estimate:
    """The mean of independent values with its 95% interval (normal). Of a single value: without an interval."""
    array = np.asarray(values, dtype=np.float64)
    if array.size == 0:
        raise ValueError("a mean of nothing")
    middle = float(array.mean())
    if array.size == 1:
        return Estimate(middle, digits=digits)
    half = Z_95 * float(array.std(ddof=1)) / sqrt(array.size)
    return Estimate(middle, middle - half, middle + half, digits=digits)


def spread(values: Sequence[float], *, percent: bool = False, digits: int = 1) -> Estimate:
    """The mean over repetitions (seeds), with the least and the most of them."""
    if not values:
        raise ValueError("a spread of nothing")
    array = np.asarray(values, dtype=np.float64)
    # A mean of equal numbers may come out a rounding below them.
    middle = float(np.clip(array.mean(), array.min(), array.max()))
    return Estimate(middle, float(array.min()), float(array.max()), percent=percent, digits=digits)


def band(label: str, x: Sequence[float], runs: npt.ArrayLike) -> Line:
    """A line over repetitions: `runs` is (repetitions, len(x)); the mean, with a band from the least to the most."""
    array = np.asarray(runs, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != len(x):
        raise ValueError(f"runs have the shape {array.shape}, x has {len(x)} values")
    return Line(label, list(x), array.mean(axis=0).tolist(), array.min(axis=0).tolist(), array.max(axis=0).tolist())


def smooth(values: npt.ArrayLike, width: int) -> npt.NDArray[np.float64]:
    """Running means along the last axis over the `width` latest values, fewer at the beginning. The same shape."""
    array = np.asarray(values, dtype=np.float64)
    if width < 1:
        raise ValueError("the width must be at least 1")
    sums = np.cumsum(np.concatenate([np.zeros((*array.shape[:-1], 1)), array], axis=-1), axis=-1)
    ends = np.arange(1, array.shape[-1] + 1)
    begins = np.maximum(ends - width, 0)
    means: npt.NDArray[np.float64] = (sums[..., ends] - sums[..., begins]) / (ends - begins)
    return means
