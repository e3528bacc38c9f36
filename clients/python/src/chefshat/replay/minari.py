"""Export to Minari, the format in which libraries for offline learning of the Farama Foundation read their datasets."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import minari
    from gymnasium import spaces
    from minari.data_collector import EpisodeBuffer
except ImportError as error:
    raise ImportError("chefshat.replay.minari needs Minari and Gymnasium: pip install 'minari[create,hdf5]' gymnasium") from error

from chefshat.envs.observing import Form, ObservationFunction
from chefshat.transitions import Transitions


def to_minari(
    transitions: Transitions,
    dataset_id: str,
    *,
    observation: str | ObservationFunction = "table",
    **metadata: Any,  # noqa: ANN401 - Those of `minari.create_dataset_from_buffers`.
) -> Any:  # noqa: ANN401 - A `minari.MinariDataset`.
    """Writes a dataset of Minari with an episode for each seat of each Shift (or game), and returns it.

    Infos have `action_mask`, one for each observation: 1 where an action was legal. An episode is truncated if its end is not among
    the transitions: it was the last one, or the game was abandoned by `reset` or `restore`.

    Args:
        transitions: for example of `from_records`, or the concatenated ones of a `VectorEnv`'s batches.
        dataset_id: for example "chefshat/greedy-v0".
        observation: the form of observations: "classic", "table", "columns" or a function; see `chefshat.envs`.
        metadata: further arguments of `minari.create_dataset_from_buffers`: `algorithm_name`, `author`, `description`, …

    Raises:
        ValueError: there are no transitions, or Minari has a dataset with this id.
    """
    if len(transitions) == 0:
        raise ValueError("there are no transitions to export")
    form = Form(observation, transitions.sizes, transitions.before)
    return minari.create_dataset_from_buffers(
        dataset_id,
        [_episode(number, transitions.take(rows), form) for number, rows in enumerate(_episodes(transitions))],
        observation_space=form.space,
        action_space=spaces.Discrete(transitions.sizes.num_actions),
        **metadata,
    )


def _episodes(transitions: Transitions) -> Iterator[NDArray[np.intp]]:
    """Yields the rows of each episode. Those of a seat of a game are in the order of time."""
    order = np.lexsort((transitions.seats, transitions.games))
    earlier, later = order[:-1], order[1:]
    ends = transitions.ended[earlier] | (transitions.games[earlier] != transitions.games[later])
    # Of an abandoned game, the last transition ends in a decision that is not the next one's.
    after, before = transitions.after, transitions.before
    for one, other in ((after, before), (after.observations, before.observations)):
        for name, column in one.as_dict().items():
            differs = column[earlier] != getattr(other, name)[later]
            ends |= differs.any(axis=tuple(range(1, differs.ndim)))
    yield from np.split(order, np.flatnonzero(ends) + 1)


def _episode(number: int, steps: Transitions, form: Form) -> EpisodeBuffer:
    last = steps.take(np.array([len(steps) - 1]))
    seen = _joined(form.of(steps.before), form.of(last.after))
    ended = bool(last.ended[0])
    truncations = np.zeros(len(steps), np.bool_)
    truncations[-1] = not ended or bool(last.truncated[0])
    terminations = steps.ended & ~truncations
    return EpisodeBuffer(
        id=number,
        observations=seen,
        actions=steps.actions.astype(np.int64),
        rewards=steps.rewards.tolist(),
        terminations=terminations.tolist(),
        truncations=truncations.tolist(),
        infos={"action_mask": np.concatenate([steps.before.masks, last.after.masks]).astype(np.int8)},
    )


def _joined(before: Any, after: Any) -> Any:  # noqa: ANN401 - Arrays, or dictionaries of them.
    if isinstance(before, dict):
        return {name: np.concatenate([before[name], after[name]]) for name in before}
    return np.concatenate([before, after])
