"""The inputs of a network: converts columns of observations to rows of numbers, a whole batch at once.

Two forms exist: `classic`, the paper's vector, and `table`, everything a seat may know. Networks are in `network`; `chefshat` (the
program) computes the same numbers in Rust. Every number is 0, 1 or one division of two small integers in single precision, so that
both are equal to the last bit.
"""

from functools import cache

import numpy as np
import numpy.typing as npt

from chefshat.columns import Observations, Situations

# Maximum number of jokers in a deck; counts of jokers are divided by it.
MAX_JOKERS = 2
# Values of Role, "no role" included.
ROLES = 6
# Decision kinds: turn, exchange, special action.
KINDS = 3
# Higher points and pizza numbers are clipped to these.
MAX_POINTS = 15
MAX_PIZZAS = 30

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]


def turn_actions(faces: int) -> int:
    """Returns T, the number of actions of a turn: 200 for 11 faces."""
    return 3 * faces * (faces + 1) // 2 + 2


def num_actions(faces: int) -> int:
    """Returns A, the number of all actions: 214 for 11 faces."""
    return turn_actions(faces) + faces + 3


def dealt(players: int, faces: int, jokers: int) -> int:
    """Returns H, the cards dealt to a hand: 17 for four players, 11 faces and 2 jokers."""
    return (faces * (faces + 1) // 2 + jokers) // players


def classic_width(faces: int, hand_size: int) -> int:
    """Returns the width of `classic`, F + H + T: the paper's 228 for 11 faces and 17 cards."""
    return faces + hand_size + turn_actions(faces)


def table_width(players: int, faces: int) -> int:
    """Returns the width of `table`: 334 for four players and 11 faces."""
    return 6 * (faces + 1) + 5 + (4 + ROLES) * players + KINDS + num_actions(faces)


def turn_column(players: int, faces: int) -> int:
    """Returns the column of `table` that is 1 at a turn and 0 at other decisions."""
    return table_width(players, faces) - num_actions(faces) - 1 - KINDS


def classic(observations: Observations, mask_bits: Bytes, *, faces: int, hand_size: int, out: Floats | None = None) -> Floats:
    """Computes the paper's vector: the board, the hand, the legal actions of a turn.

    Board (F slots): the cards of the play ascending, jokers as F+1, cut off after F slots; an empty board is F+2 in slot 0. Hand (H
    slots): ascending, zeros first. Both are divided by F+2. Then the first T bits of the mask as 0 or 1.

    It hides the kind of the decision: gifts and special actions have an empty board and no legal action in it, so a policy that
    sees only this vector cannot tell them apart. It also hides roles, points, places, who has passed, the cards of other seats, the
    cards played and exchanged, and which card is the Golden one. Use it to compare with the paper, and `table` otherwise.

    Args:
        observations: R rows of columns.
        mask_bits: (R, ceil(A/8)), packed as in `Batch.mask_bits`.
        faces: F.
        hand_size: H.
        out: (R, F+H+T) float32 to write to; None: a new array.

    Returns:
        (R, F+H+T) float32, numbers in 0..=1.
    """
    rows, turns = len(mask_bits), turn_actions(faces)
    if out is None:
        out = np.empty((rows, classic_width(faces, hand_size)), np.float32)
    scale = np.float32(faces + 2)

    face, size, jokers = (observations.boards[:, column, np.newaxis] for column in range(3))
    slot = np.arange(faces, dtype=np.uint8)
    cards = np.where(slot < size - jokers, face, np.where(slot < size, faces + 1, 0).astype(np.uint8))
    cards[:, 0] = np.where(face[:, 0] == 0, faces + 2, cards[:, 0])
    np.divide(cards, scale, out=out[:, :faces], casting="unsafe")

    # Slot i holds the lowest face whose cards, together with those of all lower faces, outnumber the slots before i.
    below = np.cumsum(observations.hands, axis=1, dtype=np.int16)
    rank = np.arange(hand_size, dtype=np.int16) - (hand_size - below[:, -1:])
    held = np.ones((rows, hand_size), np.uint8)
    for column in range(faces):
        held += below[:, column, np.newaxis] <= rank
    held[rank < 0] = 0
    np.divide(held, scale, out=out[:, faces : faces + hand_size], casting="unsafe")

    out[:, faces + hand_size :] = np.unpackbits(mask_bits, axis=1, count=turns, bitorder="little")
    return out


def table(
    observations: Observations,
    seats: Bytes,
    kinds: Bytes,
    mask_bits: Bytes,
    *,
    players: int,
    faces: int,
    hand_size: int,
    out: Floats | None = None,
) -> Floats:
    """Computes everything a seat may know, from its perspective: arrays of seats start with the seat and continue to its left.

    In this order: hand (F+1; counts of face f divided by f, of jokers by 2), holds the Golden card (1), face on the board, one-hot
    0..F+1 (F+2), cards on it / F (1), jokers on it / 2 (1), cards left / H (N), passed (N), places / N (N), roles, one-hot of 0..5
    for each seat (6N), points, at most 15, / 15 (N), cards played, scaled like the hand (F+1), cards unseen, that is of a deck with
    two jokers neither in the hand nor played, at least 0, scaled like the hand (F+1), cards given / 2 (F+1), cards received / 2
    (F+1), decision kind, one-hot turn, exchange, special action (3), pizza, at most 30, / 30 (1), legal actions as 0 or 1 (A).

    Args:
        observations: R rows of columns.
        seats: (R,), the seat of each row.
        kinds: (R,), values of DecisionKind.
        mask_bits: (R, ceil(A/8)), packed as in `Batch.mask_bits`.
        players: N.
        faces: F.
        hand_size: H.
        out: (R, `table_width`) float32 to write to; None: a new array.

    Returns:
        (R, `table_width`) float32.
    """
    rows = len(mask_bits)
    if out is None:
        out = np.empty((rows, table_width(players, faces)), np.float32)
    counts = _deck(faces).astype(np.float32)
    mine = _rotation(players)[seats]
    at = 0

    def block(width: int) -> Floats:
        nonlocal at
        at += width
        return out[:, at - width : at]

    def ratio(values: npt.NDArray[np.uint8], by: float | Floats) -> None:
        np.divide(values, np.asarray(by, np.float32), out=block(values.shape[1]), casting="unsafe")

    def by_seat(values: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        return np.take_along_axis(values, mine, axis=1)

    ratio(observations.hands, counts)
    block(1)[:, 0] = observations.golden
    block(faces + 2)[:] = np.eye(faces + 2, dtype=np.float32)[observations.boards[:, 0]]
    ratio(observations.boards[:, 1:2], faces)
    ratio(observations.boards[:, 2:3], MAX_JOKERS)
    ratio(by_seat(observations.cards_left), hand_size)
    block(players)[:] = by_seat(observations.passed)
    ratio(by_seat(observations.places), players)
    roles = np.eye(ROLES, dtype=np.float32)[by_seat(observations.roles)]
    block(ROLES * players)[:] = roles.reshape(rows, ROLES * players)
    ratio(by_seat(np.minimum(observations.points, MAX_POINTS).astype(np.uint8)), MAX_POINTS)
    ratio(observations.played, counts)
    # A count exceeds the deck's only in a wrong record; clipping prevents a wrap-around.
    seen = observations.hands + observations.played
    ratio(_deck(faces) - np.minimum(seen, _deck(faces)), counts)
    ratio(observations.gave, 2)
    ratio(observations.received, 2)
    block(KINDS)[:] = np.eye(KINDS + 1, KINDS, k=-1, dtype=np.float32)[kinds]
    ratio(np.minimum(observations.pizzas, MAX_PIZZAS).astype(np.uint8)[:, np.newaxis], MAX_PIZZAS)
    actions = num_actions(faces)
    block(actions)[:] = np.unpackbits(mask_bits, axis=1, count=actions, bitorder="little")
    return out


def classic_of(situations: Situations) -> Floats:
    """Computes `classic` for the rows of a batch."""
    sizes = situations.sizes
    return classic(situations.observations, situations.mask_bits, faces=sizes.faces, hand_size=sizes.hand_size)


def table_of(situations: Situations, out: Floats | None = None) -> Floats:
    """Computes `table` for the rows of a batch."""
    seen, sizes = situations, situations.sizes
    shape = {"players": sizes.players, "faces": sizes.faces, "hand_size": sizes.hand_size}
    return table(seen.observations, seen.seats, seen.kinds, seen.mask_bits, **shape, out=out)


@cache
def _deck(faces: int) -> Bytes:
    """Returns the cards of each face, two jokers last."""
    return np.append(np.arange(1, faces + 1), MAX_JOKERS).astype(np.uint8)


@cache
def _rotation(players: int) -> npt.NDArray[np.intp]:
    """Returns a table whose row s lists the seats from s to the left."""
    return (np.arange(players)[:, np.newaxis] + np.arange(players)) % players
