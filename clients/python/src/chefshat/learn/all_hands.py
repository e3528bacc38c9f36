"""What a critic may see in training and no player in a game: the hands of the other seats, found in the rollout of all seats.

Every seat shows its hand at its own decisions. Between two of them the hand changes only by its own plays, so the hand of another
seat is the one it last kept in this Shift, or, before its first turn, the one it has there. Used by `ppo_training`.
"""

from functools import cache

import numpy as np

from chefshat.learn import features
from chefshat.learn.self_play import Floats, Rollout


def width(players: int, faces: int) -> int:
    """Returns the width of `other_hands`: 36 for four players and 11 faces."""
    return (players - 1) * (faces + 1)


def other_hands(rollout: Rollout, players: int, faces: int) -> Floats:
    """Computes the hands of the other seats at each decision of a rollout in which the policy plays all seats.

    Hands that the rollout does not show are zeros: at exchanges and special actions, of seats that have no further turn in it, and
    of seats whose only legal action was taken without asking since (a last card, say: rare).

    Returns:
        (steps, n, (N-1)(F+1)) float32: the seats from the left neighbour on, counts scaled as in `features.table`.
    """
    steps, games = rollout.actions.shape
    played = _played(faces)
    hands = rollout.inputs[:, :, : faces + 1]
    turns = rollout.present & (rollout.inputs[:, :, features.turn_column(players, faces)] > 0)
    found = np.zeros((steps, games, players, faces + 1), np.float32)
    known = np.zeros((steps, games, players), np.bool_)
    kept, is_kept = np.zeros_like(found[0]), np.zeros_like(known[0])
    for step in range(steps):
        found[step], known[step] = kept, is_kept
        rows = np.flatnonzero(turns[step])
        here = rows, rollout.seats[step, rows]
        kept[here] = np.maximum(hands[step, rows] - played[rollout.actions[step, rows]], 0)
        is_kept[here] = True
        ended = rollout.ends[step].games
        kept[ended], is_kept[ended] = 0, False
    # From here on: the hand at the seat's next turn.
    kept[:] = 0
    for step in reversed(range(steps)):
        kept[rollout.ends[step].games] = 0
        found[step] = np.where(known[step, :, :, np.newaxis], found[step], kept)
        rows = np.flatnonzero(turns[step])
        kept[rows, rollout.seats[step, rows]] = hands[step, rows]
    others = (rollout.seats[:, :, np.newaxis] + np.arange(1, players)) % players
    result = np.take_along_axis(found, others[:, :, :, np.newaxis].astype(np.intp), axis=2)
    result[~turns] = 0
    return result.reshape(steps, games, width(players, faces))


@cache
def _played(faces: int) -> Floats:
    """Returns the cards that each action takes from a hand on its turn, (A, F+1), scaled like hands."""
    cards = np.zeros((features.num_actions(faces), faces + 1), np.float32)
    plays = [(face, naturals, jokers) for face in range(1, faces + 1) for naturals in range(1, face + 1) for jokers in range(3)]
    for action, (face, naturals, jokers) in enumerate(plays):
        cards[action, face - 1], cards[action, faces] = naturals / face, jokers / features.MAX_JOKERS
    # Then one joker alone; the others play no cards.
    cards[len(plays), faces] = 1 / features.MAX_JOKERS
    return cards
