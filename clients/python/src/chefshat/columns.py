"""Tables in columns: what a batch of a `VectorEnv` holds, as numpy views of the bytes that came over the wire.

A table has rows; a column has one value, or one row of values, for each of them. A column is made when it is first asked for,
without copying, and is read-only. Where tables come from is not here (see `vector`), nor what follows from two of them (see
`transitions`).

R is the number of rows, N of seats, F of faces, A of actions (standard 4, 11, 214). Arrays of cards are F+1 wide: index f-1 counts
face f, index F the jokers. Arrays of seats are N wide.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from chefshat import pb
from chefshat.errors import ChefsHatError
from chefshat.masks import unpack

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Sizes:
    """The numbers that the widths of columns follow from.

    Attributes:
        players: N, the number of seats.
        faces: F, the number of faces in the deck.
        jokers: jokers in the deck, 0..=2.
        hand_size: H, the cards dealt to a hand.
        num_actions: A, the number of actions of any kind.
        turn_actions: T, the number of actions of a turn; they come first, and the last of them is passing.
    """

    players: int
    faces: int
    jokers: int
    hand_size: int
    num_actions: int
    turn_actions: int

    @property
    def card_kinds(self) -> int:
        """F+1: the faces and the joker."""
        return self.faces + 1

    @property
    def mask_bytes(self) -> int:
        """Bytes that hold a mask, ceil(A/8)."""
        return -(-self.num_actions // 8)


class Column(Generic[Scalar]):
    """A column of a table: made when it is first asked for, and kept."""

    def __init__(self, dtype: str, width: int | str = 1, *, field: str = "") -> None:
        """Describes a column.

        Args:
            dtype: numpy's name for the type on the wire.
            width: values per row, or the attribute of `Sizes` that says it; 1: the column has one dimension.
            field: the message's field, if it is not called as the column is.
        """
        self.dtype = np.dtype(dtype)
        self._width = width
        self._field = field
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name
        self._field = self._field or name

    def shape(self, rows: int, sizes: Sizes) -> tuple[int, ...]:
        """The shape of so many rows."""
        width = self._width
        if isinstance(width, str):
            width = int(getattr(sizes, width))
        return (rows,) if width == 1 else (rows, width)

    @overload
    def __get__(self, table: None, owner: type) -> Self: ...
    @overload
    def __get__(self, table: "Table", owner: type) -> NDArray[Scalar]: ...
    def __get__(self, table: "Table | None", owner: type) -> "Self | NDArray[Scalar]":
        if table is None:
            return self
        shape = self.shape(len(table), table.sizes)
        if table.source is not None:
            array: NDArray[Scalar] = table.source(self._name)
        elif table.message is None:
            array = np.zeros(shape, self.dtype)
            array.flags.writeable = False
        else:
            column: bytes = getattr(table.message, self._field)
            try:
                array = np.frombuffer(column, self.dtype).reshape(shape)
            except ValueError as error:
                told = f"the column {self._field} has {len(column)} bytes, which is not {shape} of {self.dtype}"
                raise ChefsHatError("COLUMN_WRONG", f"{told}; are server and client of one version?") from error
        # Found there before this descriptor from now on.
        table.__dict__[self._name] = array
        return array


class Table:
    """Rows in columns. Subclasses name the columns.

    Attributes:
        sizes: the numbers that widths follow from.
        message: what the columns are read from; None for a table put together from arrays, where a column left out is all zeros.
        source: makes columns by name instead, if there is no message.
    """

    source: Callable[[str], NDArray[Any]] | None = None

    def __init__(self, rows: int, sizes: Sizes, message: Message | None = None) -> None:
        self.sizes = sizes
        self.message = message
        self._rows = rows

    @classmethod
    def of(cls, rows: int, sizes: Sizes, columns: Mapping[str, Any]) -> Self:
        """A table put together from arrays, by the names of the columns."""
        table = cls(rows, sizes)
        table.__dict__.update(columns)
        return table

    @classmethod
    def columns(cls) -> dict[str, Column[Any]]:
        """The columns by name."""
        found: dict[str, Column[Any]] = {}
        for base in reversed(cls.__mro__):
            found.update({name: value for name, value in vars(base).items() if isinstance(value, Column)})
        return found

    def __len__(self) -> int:
        return self._rows

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._rows} rows)"

    def as_dict(self) -> dict[str, NDArray[Any]]:
        """The columns as arrays, by name."""
        return {name: getattr(self, name) for name in self.columns()}

    def take(self, rows: NDArray[Any]) -> Self:
        """The rows of these numbers (or where this mask is true), as a table of its own."""
        columns = {name: array[rows] for name, array in self.as_dict().items()}
        count = int(np.count_nonzero(rows)) if rows.dtype == np.bool_ else len(rows)
        return self.of(count, self.sizes, columns)


class Observations(Table):
    """What a seat may know, a row for each time it is told. Own cards are those of the seat that the row is for."""

    shifts = Column[np.uint32]("<u4")
    """(R,): number of the Shift, from 1."""
    pizzas = Column[np.uint32]("<u4")
    """(R,): pizza of the Shift being made, from 1; 0 before the Shift's first turn is open."""
    hands = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): own hand."""
    golden = Column[np.uint8]("u1")
    """(R,): 1 if the own hand holds the Golden card."""
    boards = Column[np.uint8]("u1", 3)
    """(R, 3): face on the board (0 empty, F+1 a joker alone), number of cards, jokers among them."""
    cards_left = Column[np.uint8]("u1", "players")
    """(R, N): cards in each hand."""
    passed = Column[np.uint8]("u1", "players")
    """(R, N): 1 where a seat has passed and is out of the pizza."""
    places = Column[np.uint8]("u1", "players")
    """(R, N): place of each seat that has finished the Shift, from 1; else 0."""
    roles = Column[np.uint8]("u1", "players")
    """(R, N): values of `pb.Role`."""
    points = Column[np.uint32]("<u4", "players")
    """(R, N): points so far in the game."""
    played = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): cards played so far in the Shift by anybody."""
    gave = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): cards this seat gave in the Shift's exchange."""
    received = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): cards this seat received in the Shift's exchange."""


class Situations(Table):
    """What seats see, and what they may do: all that an observation for an agent can be made of.

    A custom observation is a function of it: it works on a `Batch`, on its `endings`, and on both sides of `Transitions`.
    """

    seats = Column[np.uint8]("u1")
    """(R,): the seat that sees."""
    kinds = Column[np.uint8]("u1")
    """(R,): what it decides, values of `pb.DecisionKind`; 0 if nothing."""
    mask_bits = Column[np.uint8]("u1", "mask_bytes", field="action_masks")
    """(R, ceil(A/8)): legal actions: bit i%8 of byte i//8 is action i; none if it decides nothing."""

    @cached_property
    def observations(self) -> Observations:
        """What the seats may know."""
        message = None if self.message is None else getattr(self.message, "observations")  # noqa: B009 - of several messages.
        return Observations(len(self), self.sizes, message)

    @cached_property
    def masks(self) -> NDArray[np.bool_]:
        """(R, A): whether each action is legal."""
        return unpack(self.mask_bits, self.sizes.num_actions)

    def take(self, rows: NDArray[Any]) -> Self:
        """The rows of these numbers (or where this mask is true), observations included."""
        taken = super().take(rows)
        taken.__dict__["observations"] = self.observations.take(rows)
        return taken


class Endings(Situations):
    """The episodes of the client's seats that have ended since the batch before, what each seat saw at the end included.

    By game, then in the order in which they ended, then by seat. Nothing is decided at an end: `kinds` are 0 and the masks empty.
    """

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1."""
    indices = Column[np.uint64]("<u8")
    """(R,): the game's index, as in `Beginnings`: more than one game of a number may end within a step."""
    rewards = Column[np.float32]("<f4")
    """(R,): sum of the seat's rewards since it last decided."""
    ends = Column[np.uint8]("u1")
    """(R,): values of `pb.EpisodeEnd`: finished, or cut short by the limit of turns."""
    game_over = Column[np.uint8]("u1")
    """(R,): 1 if the game is over, too."""
    places_taken = Column[np.uint8]("u1")
    """(R,): the seat's place, from 1: in the Shift, or in the game where that is the episode."""

    def __init__(self, rows: int, sizes: Sizes, message: pb.EpisodeEndings | None = None) -> None:
        super().__init__(rows, sizes, message)
        if message is not None:
            self.__dict__["kinds"] = np.zeros(rows, np.uint8)
            self.__dict__["mask_bits"] = np.zeros((rows, sizes.mask_bytes), np.uint8)


class Beginnings(Table):
    """The games that have begun since the batch before."""

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1, ascending."""
    indices = Column[np.uint64]("<u8")
    """(R,): its index: the k-th to begin (from 0) as game g of n has the index g + k*n."""
    seeds = Column[np.uint8]("u1", 32)
    """(R, 32): its seed."""


class ShiftStatistics(Table):
    """The Shifts that have ended since the batch before, where they were asked for."""

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1."""
    indices = Column[np.uint64]("<u8")
    """(R,): the game's index."""
    shifts = Column[np.uint32]("<u4")
    """(R,): number of the Shift in its game, from 1."""
    starters = Column[np.uint8]("u1")
    """(R,): seat that took the first turn."""
    pizzas = Column[np.uint32]("<u4")
    """(R,): pizzas, the one in progress at the end included."""
    laps = Column[np.uint32]("<u4")
    """(R,): laps, the one in progress at the end included."""
    turns = Column[np.uint32]("<u4")
    """(R,): turns."""
    special_actions = Column[np.uint8]("u1")
    """(R,): values of `pb.SpecialAction`."""
    adjudicated = Column[np.uint8]("u1")
    """(R,): 1 if the Shift reached its limit of turns."""
    game_winners = Column[np.uint8]("u1")
    """(R,): the seat that won the game if this Shift ended it; 255 if the game goes on."""
    places = Column[np.uint8]("u1", "players")
    """(R, N): place of each seat, from 1."""
    points = Column[np.uint32]("<u4", "players")
    """(R, N): points of each seat in the Shift."""
    valid = Column[np.uint32]("<u4", "players")
    """(R, N): valid actions at turns."""
    wrong = Column[np.uint32]("<u4", "players")
    """(R, N): wrong actions, that is invalid attempts at turns."""
    passes = Column[np.uint32]("<u4", "players")
    """(R, N): passes."""
    reward_sums = Column[np.float32]("<f4", "players")
    """(R, N): sum of each seat's rewards, built-in agents' included."""
    performance = Column[np.float32]("<f4", "players")
    """(R, N): performance score, the running mean over the game's Shifts of 10 * points / pizzas."""


@dataclass(frozen=True, slots=True)
class Totals:
    """Counts since the stream began.

    Attributes:
        client_decisions: decisions of the client that were taken.
        decisions: all decisions that were taken.
        invalid_attempts: invalid attempts of the client, at decisions of any kind.
        shifts: Shifts that have ended.
        games: games that have ended.
    """

    client_decisions: int
    decisions: int
    invalid_attempts: int
    shifts: int
    games: int
