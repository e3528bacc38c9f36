"""A single row of a native batch, read without an array for each column: what makes one game fast, in Gymnasium and PettingZoo.

Reading one number through a column costs as much as a step of the game. Larger batches are read by their columns, and by
`chefshat.learn.features`, which computes the same numbers; those of a single row are looked up in tables of all values of a byte.
"""

from collections.abc import Mapping
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chefshat.batch import Batch
from chefshat.columns import Endings, Situations, Sizes
from chefshat.envs.observing import Form
from chefshat.learn import features

Values = NDArray[np.float32]

_BYTE = np.arange(256, dtype=np.uint8)
_REWARD = Struct("<f").unpack_from
_COUNT = Struct("<I").unpack_from


class Seen(NamedTuple):
    """What an environment shows of a row.

    Attributes:
        observation: of its form, without the mask.
        mask: (A,): 1 where an action is legal; zeros at an end.
        reward: the reward.
        seat: the seat.
        kind: the kind of the decision; 0 at an end.
        attempts: the invalid attempts at the decision; 0 at an end.
    """

    observation: Any
    mask: NDArray[np.int8]
    reward: float
    seat: int
    kind: int
    attempts: int


class RowReader:
    """Reads the first row of the batches of one game, and of their endings: fast if it is alone in its table."""

    def __init__(self, form: Form, batch: Batch, *, own_rewards: bool) -> None:
        """Prepares.

        Args:
            form: the form of observations.
            batch: the first one.
            own_rewards: whether a reward function computes the rewards, which are not in the rows then.
        """
        self._form = form
        self._actions = batch.sizes.num_actions
        self._singles: dict[type[Situations], SingleRow] = {}
        for table in (batch, batch.endings):
            if table.packed is not None and not own_rewards:
                self._singles[type(table)] = SingleRow(batch.sizes, table.packed.before)

    def read(self, now: Batch | Endings) -> Seen:
        """Reads the first row."""
        packed = now.packed
        single = self._singles.get(type(now))
        if single is None or packed is None or len(now) != 1:
            attempts = int(now.attempts[0]) if isinstance(now, Batch) else 0
            observation = self._form.row(self._form.of(now), 0)
            mask = np.array(now.masks[0], np.int8)
            return Seen(observation, mask, float(now.rewards[0]), int(now.seats[0]), int(now.kinds[0]), attempts)
        row = packed.columns
        observed = single.table(row) if self._form.is_table else None
        if observed is not None:
            # The mask is its last part.
            mask = observed[-self._actions :].astype(np.int8)
        else:
            mask = single.mask(row)
            observed = self._form.row(self._form.of(now), 0)
        kind, attempts = (single.kind(row), single.attempts(row)) if isinstance(now, Batch) else (0, 0)
        return Seen(observed, mask, single.reward(row), single.seat(row), kind, attempts)


class SingleRow:
    """Reads a row that is alone in its table."""

    def __init__(self, sizes: Sizes, before: Mapping[str, int]) -> None:
        """Prepares.

        Args:
            sizes: the numbers that determine widths.
            before: the bytes of the row before each column; a table of endings has neither kinds nor masks.
        """
        self._actions = sizes.num_actions
        first = before.get("mask_bits")
        self._mask = None if first is None else slice(first, first + sizes.mask_bytes)
        self._reward, self._seat = before["rewards"], before["seats"]
        # Not of endings.
        self._attempts, self._kind = before.get("attempts", 0), before.get("kinds", 0)
        self._lookup = _TableLookup(sizes, before)

    def reward(self, row: NDArray[np.uint8]) -> float:
        """Returns the reward."""
        return float(_REWARD(row.data, self._reward)[0])

    def seat(self, row: NDArray[np.uint8]) -> int:
        """Returns the seat."""
        return int(row[self._seat])

    def attempts(self, row: NDArray[np.uint8]) -> int:
        """Returns the invalid attempts at the decision."""
        return int(_COUNT(row.data, self._attempts)[0])

    def kind(self, row: NDArray[np.uint8]) -> int:
        """Returns the kind of the decision."""
        return int(row[self._kind])

    def mask(self, row: NDArray[np.uint8]) -> NDArray[np.int8]:
        """Returns the mask: A numbers, 1 where an action is legal; zeros at an end."""
        if self._mask is None:
            return np.zeros(self._actions, np.int8)
        return np.unpackbits(row[self._mask], count=self._actions, bitorder="little").view(np.int8)

    def table(self, row: NDArray[np.uint8]) -> Values | None:
        """Returns `features.table` of the row; None if a number is too large to be looked up."""
        return self._lookup(row)


class _TableLookup:
    """Computes `features.table`: each of its numbers depends on one byte of the row, or on the sum of two."""

    def __init__(self, sizes: Sizes, before: Mapping[str, int]) -> None:
        players, faces, cards = sizes.players, sizes.faces, sizes.card_kinds
        deck = [*range(1, faces + 1), features.MAX_JOKERS]
        # The bytes of the row, of which the last column is at most as wide as cards; a zero; sums of cards in the hand and played.
        zero = max(before.values()) + cards
        sums = zero + 1
        self._bytes = np.zeros(sums + cards, np.uint8)
        self._sums = self._bytes[sums:]
        self._added = slice(before["hands"], before["hands"] + cards), slice(before["played"], before["played"] + cards)
        self._seat = before["seats"]
        # Numbers of four bytes, of which only the lowest is looked up.
        self._wide = ((_COUNT, before["pizzas"]), (Struct(f"<{players}I").unpack_from, before["points"]))

        tables: dict[tuple[str, int], int] = {}
        values: list[Values] = []

        def table(kind: str, number: int, made: NDArray[Any]) -> int:
            """Returns the place of the table of a function of a byte."""
            if (kind, number) not in tables:
                tables[kind, number] = 256 * len(values)
                values.append(np.asarray(made, np.float32))
            return tables[kind, number]

        def share(by: int, most: int = 255) -> int:
            return table(f"share up to {most}", by, np.minimum(_BYTE, np.uint8(most)) / np.float32(by))

        def equal(value: int) -> int:
            return table("equal", value, np.equal(_BYTE, value))

        def unseen(of: int) -> int:
            return table("unseen", of, (np.uint8(of) - np.minimum(_BYTE, np.uint8(of))) / np.float32(of))

        def bit(number: int) -> int:
            return table("bit", number, _BYTE >> np.uint8(number) & 1)

        def numbers(seat: int) -> list[tuple[int, int]]:
            """Returns for each number the byte it depends on and the place of its table."""
            left = [(seat + number) % players for number in range(players)]
            found = [(before["hands"] + card, share(deck[card])) for card in range(cards)]
            found.append((before["golden"], share(1)))
            board = before["boards"]
            found += [(board, equal(face)) for face in range(faces + 2)]
            found += [(board + 1, share(faces)), (board + 2, share(features.MAX_JOKERS))]
            found += [(before["cards_left"] + other, share(sizes.hand_size)) for other in left]
            found += [(before["passed"] + other, share(1)) for other in left]
            found += [(before["places"] + other, share(players)) for other in left]
            found += [(before["roles"] + other, equal(role)) for other in left for role in range(features.ROLES)]
            points = features.MAX_POINTS
            found += [(before["points"] + 4 * other, share(points, points)) for other in left]
            found += [(before["played"] + card, share(deck[card])) for card in range(cards)]
            found += [(sums + card, unseen(deck[card])) for card in range(cards)]
            found += [(before[name] + card, share(2)) for name in ("gave", "received") for card in range(cards)]
            found += [(before.get("kinds", zero), equal(kind + 1)) for kind in range(features.KINDS)]
            found.append((before["pizzas"], share(features.MAX_PIZZAS, features.MAX_PIZZAS)))
            masks = before.get("mask_bits")
            for action in range(sizes.num_actions):
                found.append((zero if masks is None else masks + action // 8, bit(action % 8)))
            return found

        each = np.array([numbers(seat) for seat in range(players)], np.intp)
        self._from, self._tables = np.ascontiguousarray(each[:, :, 0]), np.ascontiguousarray(each[:, :, 1])
        self._values = np.concatenate(values)

    def __call__(self, row: NDArray[np.uint8]) -> Values | None:
        for read, at in self._wide:
            if max(read(row.data, at)) > 255:
                return None
        seat = row[self._seat]
        hand, played = self._added
        self._bytes[: row.size] = row
        np.add(row[hand], row[played], out=self._sums)
        found: Values = self._values.take(self._bytes.take(self._from[seat]) + self._tables[seat])
        return found
