"""What actions of a position are worth: means over deals, and the policy that follows from them. `search` finds them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

# How much rollouts count beside a prior: those of mctx.
_FIRST_ROLLOUTS = 50
_SCALE = 0.1


@dataclass(frozen=True)
class Outcomes:
    """What actions brought in the same deals.

    Attributes:
        actions: (A,) the actions.
        points: (D, A) points of the Shift, or of a leaf, in each deal.
        places: (D, A) places, from 1; NaN where a leaf was valued.
    """

    actions: NDArray[np.uint16]
    points: NDArray[np.float64]
    places: NDArray[np.float64]

    def estimates(self, weights: ArrayLike | None = None) -> "Estimates":
        """Returns the means over the deals.

        Args:
            weights: (D,) how likely each deal is in relation to the others, in numbers of 0 or more: for instance the likelihood of
                what the other seats did, by a model of them. The standard errors count deals by their effective number.
        """
        deals, actions = self.points.shape
        share = _shares(np.ones(deals) if weights is None else weights, deals)
        if share is None:
            raise ValueError(f"weights: give a finite number of 0 or more for each of the {deals} deals, not all 0")
        points, gains = mean_and_error(self.points, share), mean_and_error(self.points - self.points[:, :1], share)
        return Estimates(self.actions, *points, *gains, share @ self.places, np.full(actions, deals, np.uint64))


@dataclass(frozen=True)
class Estimates:
    """What actions are worth, in their order. All were tried in the same deals, some perhaps only in the first of them.

    Attributes:
        actions: (A,) the actions.
        points: mean points of the Shift.
        standard_errors: of `points`; infinite after fewer than two rollouts.
        gains: mean of the points gained over the first action in the same deals.
        gain_errors: standard errors of `gains`.
        places: mean place in the Shift, from 1; NaN with `leaf`.
        rollouts: number of rollouts of each action, at least 4 unless `deals` are fewer; 0 for actions that a `prior` left out,
            whose other numbers are NaN.
    """

    actions: NDArray[np.uint16]
    points: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    gains: NDArray[np.float64]
    gain_errors: NDArray[np.float64]
    places: NDArray[np.float64]
    rollouts: NDArray[np.uint64]

    @property
    def best(self) -> int:
        """The action with the most points among those with the most rollouts."""
        tried = self.rollouts == self.rollouts.max()
        return int(self.actions[np.where(tried, self.points, -np.inf).argmax()])

    def improved(self, prior: ArrayLike) -> NDArray[np.float64]:
        """Returns the policy that these estimates make of a prior one, as a target for learning.

        By "Policy improvement by planning with Gumbel" (Danihelka et al., 2022), equation 11: the softmax of the prior's logarithm
        and of the points, on a scale of 0 to 1, times `0.1 (50 + the most rollouts)`. An action without rollouts has the mean
        points of the others, weighted by the prior.

        Args:
            prior: (A,) probabilities of the actions.

        Returns:
            (A,) probabilities.
        """
        given = checked_prior(prior, len(self.actions))
        tried = self.rollouts > 0
        known = np.where(tried, self.points, 0.0)
        mass = given[tried].sum()
        mean = (given @ known) / mass if mass else known[tried].mean()
        points = np.where(tried, self.points, mean)
        logits = scores(points, given, int(self.rollouts.max()))
        policy = np.exp(logits - logits.max())
        policy /= policy.sum()
        return np.asarray(policy)


def mean_and_error(values: NDArray[np.float64], share: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the mean over the deals, each with its share of 1, and the mean's standard error."""
    mean = share @ values
    # The number of deals that would tell as much if all had the same share (Kish).
    effective = 1 / np.square(share).sum()
    if effective < 1 + 1e-9:
        return mean, np.full(np.shape(mean), np.inf)
    return mean, np.sqrt(np.square(share) @ np.square(values - mean) * effective / (effective - 1))


def scores(points: NDArray[np.float64], prior: NDArray[np.float64], rollouts: int) -> NDArray[np.float64]:
    """Returns the logits of actions by points and prior, see `Estimates.improved`."""
    low, high = points.min(), points.max()
    scaled = (points - low) / (high - low) if high > low else np.zeros_like(points)
    with np.errstate(divide="ignore"):
        logits: NDArray[np.float64] = np.log(prior) + _SCALE * (_FIRST_ROLLOUTS + rollouts) * scaled
    return logits


def checked_prior(prior: ArrayLike, actions: int) -> NDArray[np.float64]:
    """Returns the probabilities of actions, which sum to 1. Raises ValueError if they are none."""
    shares = _shares(prior, actions)
    if shares is None:
        raise ValueError(f"prior: give the probability of each of the {actions} actions")
    return shares


def _shares(given: ArrayLike, count: int) -> NDArray[np.float64] | None:
    """Returns numbers as shares of their sum; None if they are not `count` finite numbers of 0 or more, or if all are 0."""
    numbers = np.asarray(given, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all() or numbers.min() < 0 or numbers.max() == 0:
        return None
    # The sum of large numbers would overflow.
    numbers = numbers / numbers.max()
    return np.asarray(numbers / numbers.sum())
