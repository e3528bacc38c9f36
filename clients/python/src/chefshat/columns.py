"""Tables in columns: the contents of a `VectorEnv`'s batch, as numpy views of the bytes of a server or of the native engine.

A table has rows; a column has one value, or one row of values, for each of them. Columns are created on first use, without copying,
and are read-only. The stream is in `vector`, pairs of decisions are in `transitions`.

R is the number of rows, N of seats, F of faces, A of actions (by default N=4, F=11, A=214). Arrays of cards are F+1 wide: index
f-1 counts face f, index F the jokers. Arrays of seats are N wide.

Counts are unsigned: a difference that would be negative wraps around (2 - 3 is 255 in u1). Convert them first, for instance
`batch.observations.points.astype(np.int64)`.

Tables can be pickled and copied; what comes back is made of arrays, whatever the table was made from.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, NamedTuple, Self, TypeVar, overload

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from chefshat import pb
from chefshat.errors import ChefsHatError
from chefshat.masks import unpack

Scalar = TypeVar("Scalar", bound=np.generic)
#: In a column of seats: there is none.
NO_SEAT = 255


@dataclass(frozen=True, slots=True)
class Sizes:
    """The numbers that determine the widths of columns.

    Attributes:
        players: N, the number of seats.
        faces: F, the number of faces in the deck.
        jokers: jokers in the deck, 0..=2.
        hand_size: H, the cards dealt to a hand.
        num_actions: A, the number of actions of any kind.
        turn_actions: T, the number of actions of a turn; they come first, and the last of them is passing.
        history: the width of the column `history`; 0: there is none.
        has_all_hands: whether there is the column `all_hands`.
    """

    players: int
    faces: int
    jokers: int
    hand_size: int
    num_actions: int
    turn_actions: int
    history: int = 0
    has_all_hands: bool = False

    @classmethod
    def of(cls, started: pb.VectorStarted | pb.GameStarted) -> Self:
        """Returns the numbers of the games that have been started."""
        return cls(
            players=started.rules.players,
            faces=started.rules.faces,
            jokers=started.rules.jokers,
            hand_size=started.hand_size,
            num_actions=started.action_space.size,
            turn_actions=started.action_space.turn_actions,
            # A live game has no such columns.
            history=started.history if isinstance(started, pb.VectorStarted) else 0,
            has_all_hands=isinstance(started, pb.VectorStarted) and started.all_hands,
        )

    @property
    def has_history(self) -> int:
        """1 if there is a history, else 0."""
        return min(self.history, 1)

    @property
    def card_kinds(self) -> int:
        """F+1: the faces and the joker."""
        return self.faces + 1

    @property
    def all_hands(self) -> int:
        """N(F+1), the width of the column `all_hands`; 0: there is none."""
        return self.players * self.card_kinds if self.has_all_hands else 0

    @property
    def mask_bytes(self) -> int:
        """Bytes that hold a mask, ceil(A/8)."""
        return -(-self.num_actions // 8)


class Column(Generic[Scalar]):
    """A column of a table, created on first use and cached."""

    def __init__(self, dtype: str, width: int | str = 1, *, field: str = "") -> None:
        """Describes a column.

        Args:
            dtype: numpy's name of the type in messages.
            width: values per row, or the name of an attribute of `Sizes`; 1: the column has one dimension.
            field: the message's field, if its name differs from the column's.
        """
        self.dtype = np.dtype(dtype)
        self._width = width
        self._field = field
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name
        self._field = self._field or name

    def shape(self, rows: int, sizes: Sizes) -> tuple[int, ...]:
        """Returns the shape of `rows` rows."""
        width = self._width
        if isinstance(width, str):
            width = int(getattr(sizes, width))
        return (rows,) if width == 1 and self._width != "history" else (rows, width)

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
        elif table.packed is not None:
            columns, before = table.packed
            array = np.ndarray(shape, self.dtype, columns, before[self._name] * table._rows)
        elif table.message is None:
            array = np.zeros(shape, self.dtype)
            array.flags.writeable = False
        else:
            column: bytes = getattr(table.message, self._field)
            try:
                array = np.frombuffer(column, self.dtype).reshape(shape)
            except ValueError as error:
                message = f"the column {self._field} has {len(column)} bytes, which is not {shape} of {self.dtype}"
                raise ChefsHatError("COLUMN_WRONG", f"{message}; do the versions of server and client match?") from error
        # Shadows this descriptor from now on.
        table.__dict__[self._name] = array
        return array


class Packed(NamedTuple):
    """Columns one after the other.

    Attributes:
        columns: their bytes.
        before: the bytes of a row before each column, by name: a column begins at as many for each row.
    """

    columns: NDArray[np.uint8]
    before: Mapping[str, int]


class Table:
    """Rows in columns. Subclasses define the columns.

    Attributes:
        sizes: the numbers that determine widths.
        message: the message with the columns; None for a table made from arrays, where an omitted column is all zeros.
        packed: the columns of a table of games in this process.
        source: creates columns by name, if there is neither.
    """

    message: Message | None = None
    packed: Packed | None = None
    source: Callable[[str], NDArray[Any]] | None = None

    def __init__(self, rows: int, sizes: Sizes, message: Message | None = None) -> None:
        self.sizes = sizes
        self.message = message
        self._rows = rows

    @classmethod
    def of(cls, rows: int, sizes: Sizes, columns: Mapping[str, Any]) -> Self:
        """Creates a table from arrays, by the names of the columns."""
        table = cls(rows, sizes)
        table.__dict__.update(columns)
        return table

    @classmethod
    def columns(cls) -> dict[str, Column[Any]]:
        """Returns the columns by name."""
        found: dict[str, Column[Any]] = {}
        for base in reversed(cls.__mro__):
            found.update({name: value for name, value in vars(base).items() if isinstance(value, Column)})
        return found

    def __len__(self) -> int:
        return self._rows

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._rows} rows)"

    @classmethod
    def columns_of(cls, sizes: Sizes) -> dict[str, Column[Any]]:
        """Returns the columns that tables of these sizes have, by name: without a history also without its columns."""
        return {name: column for name, column in cls.columns().items() if 0 not in column.shape(1, sizes)}

    def _contents(self) -> dict[str, Any]:
        """All that a copy needs, by attribute. Subclasses add what is not a column."""
        return self.as_dict()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._made_of_arrays, len(self), self.sizes, self._contents())

    @property
    def _made_of_arrays(self) -> "type[Table]":
        """The class of a copy."""
        return type(self)

    def as_dict(self) -> dict[str, NDArray[Any]]:
        """Returns the columns as arrays, by name."""
        return {name: getattr(self, name) for name in self.columns_of(self.sizes)}

    @classmethod
    def concatenated(cls, tables: Sequence[Self]) -> Self:
        """Returns a table of the rows of one or more tables, in order."""
        sizes = tables[0].sizes
        columns = {name: np.concatenate([getattr(table, name) for table in tables]) for name in cls.columns_of(sizes)}
        return cls.of(sum(map(len, tables)), sizes, columns)

    def take(self, rows: NDArray[Any]) -> Self:
        """Returns a table of the rows with these indices (or where this mask is true)."""
        columns = {name: array[rows] for name, array in self.as_dict().items()}
        count = int(np.count_nonzero(rows)) if rows.dtype == np.bool_ else len(rows)
        return self.of(count, self.sizes, columns)


def _restored(kind: type[Table], rows: int, sizes: Sizes, contents: Mapping[str, Any]) -> Table:
    """Creates a table that was pickled or copied."""
    return kind.of(rows, sizes, contents)


class Observations(Table):
    """What a seat may know, one row each. `hands` and other cards are those of the row's seat."""

    shifts = Column[np.uint32]("<u4")
    """(R,): number of the Shift, from 1."""
    pizzas = Column[np.uint32]("<u4")
    """(R,): current pizza of the Shift, from 1; 0 before the Shift's first turn."""
    hands = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): own hand."""
    golden = Column[np.uint8]("u1")
    """(R,): 1 if the hand has the Golden card."""
    boards = Column[np.uint8]("u1", 3)
    """(R, 3): face on the board (0 empty, F+1 a joker alone), number of cards, jokers among them."""
    board_owners = Column[np.uint8]("u1")
    """(R,): the seat that played the cards on the board; `NO_SEAT` if it is empty."""
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
    """(R, F+1): cards played so far in the Shift by all seats."""
    gave = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): cards this seat gave in the Shift's exchange."""
    received = Column[np.uint8]("u1", "card_kinds")
    """(R, F+1): cards this seat received in the Shift's exchange."""
    history = Column[np.uint16]("<u2", "history")
    """(R, K): the latest actions of the Shift that the seat may know, the most recent last, after zeros. See `chefshat.history`."""
    history_counts = Column[np.uint32]("<u4", "has_history")
    """(R,): number of these actions since the Shift began, more than K if the column lacks some; (R, 0) without history."""


class Situations(Table):
    """What seats see, and which actions are legal: the input of a custom observation function.

    Such a function works on a `Batch`, on its `endings`, and on both sides of `Transitions`.
    """

    seats = Column[np.uint8]("u1")
    """(R,): the seat."""
    kinds = Column[np.uint8]("u1")
    """(R,): kind of its decision, values of `pb.DecisionKind`; 0 if it has none."""
    mask_bits = Column[np.uint8]("u1", "mask_bytes", field="action_masks")
    """(R, ceil(A/8)): legal actions: bit i%8 of byte i//8 is action i; no bits without a decision."""

    @cached_property
    def observations(self) -> Observations:
        """The observations of the seats."""
        message = None if self.message is None else getattr(self.message, "observations")  # noqa: B009 - of several messages.
        seen = Observations(len(self), self.sizes, message)
        seen.packed = self.packed
        return seen

    @cached_property
    def masks(self) -> NDArray[np.bool_]:
        """(R, A): whether each action is legal."""
        return unpack(self.mask_bits, self.sizes.num_actions)

    def _contents(self) -> dict[str, Any]:
        return super()._contents() | {"observations": self.observations}

    @classmethod
    def concatenated(cls, tables: Sequence[Self]) -> Self:
        """Returns the rows of one or more tables, in order, with observations."""
        joined = super().concatenated(tables)
        joined.__dict__["observations"] = Observations.concatenated([table.observations for table in tables])
        return joined

    def take(self, rows: NDArray[Any]) -> Self:
        """Returns the rows with these indices (or where this mask is true), with observations."""
        taken = super().take(rows)
        taken.__dict__["observations"] = self.observations.take(rows)
        return taken


class Endings(Situations):
    """The episodes of the client's seats that have ended since the last batch, with the final observation of each.

    Ordered by game, then by end, then by seat. There is no decision at an end: `kinds` are 0 and the masks empty.
    """

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1."""
    indices = Column[np.uint64]("<u8")
    """(R,): the game's index, as in `Beginnings`: several games with the same number may end within a step."""
    rewards = Column[np.float32]("<f4")
    """(R,): sum of the seat's rewards since it last decided."""
    ends = Column[np.uint8]("u1")
    """(R,): values of `pb.EpisodeEnd`, as the server reports them. See `truncated`."""
    game_over = Column[np.uint8]("u1")
    """(R,): 1 if the game is over, too."""
    places_taken = Column[np.uint8]("u1")
    """(R,): the seat's place, from 1: in the Shift, or in the game if that is the episode."""

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """(R,): whether the episode was cut off without places. An adjudicated Shift has places and terminates."""
        return np.asarray((self.ends != pb.EPISODE_END_FINISHED) & (self.places_taken == 0))

    def first_of_each_game(self) -> "Endings":
        """Returns the first ending of each game, for one seat of the client: it had no decision in further ones."""
        first = np.unique(self.games, return_index=True)[1]
        return self if len(first) == len(self) else self.take(first)

    def __init__(self, rows: int, sizes: Sizes, message: pb.EpisodeEndings | None = None) -> None:
        super().__init__(rows, sizes, message)
        self.__dict__["kinds"] = np.zeros(rows, np.uint8)
        self.__dict__["mask_bits"] = np.zeros((rows, sizes.mask_bytes), np.uint8)


class Beginnings(Table):
    """The games that have begun since the last batch."""

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1, ascending."""
    indices = Column[np.uint64]("<u8")
    """(R,): its index: the k-th to begin (from 0) as game g of n has the index g + k*n."""
    seeds = Column[np.uint8]("u1", 32)
    """(R, 32): its seed."""


class ShiftStatistics(Table):
    """The Shifts that have ended since the last batch."""

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1."""
    indices = Column[np.uint64]("<u8")
    """(R,): the game's index."""
    shifts = Column[np.uint32]("<u4")
    """(R,): number of the Shift in its game, from 1."""
    starters = Column[np.uint8]("u1")
    """(R,): seat that took the first turn."""
    pizzas = Column[np.uint32]("<u4")
    """(R,): pizzas, including the one in progress at the end."""
    laps = Column[np.uint32]("<u4")
    """(R,): laps, including the one in progress at the end."""
    turns = Column[np.uint32]("<u4")
    """(R,): turns."""
    special_actions = Column[np.uint8]("u1")
    """(R,): values of `pb.SpecialAction`."""
    adjudicated = Column[np.uint8]("u1")
    """(R,): 1 if the Shift reached its limit of turns and was adjudicated."""
    game_winners = Column[np.uint8]("u1")
    """(R,): the seat that won the game if this Shift ended it; 255 if the game continues."""
    places = Column[np.uint8]("u1", "players")
    """(R, N): place of each seat, from 1."""
    points = Column[np.uint32]("<u4", "players")
    """(R, N): points of each seat in the Shift."""
    valid = Column[np.uint32]("<u4", "players")
    """(R, N): valid actions at turns."""
    wrong = Column[np.uint32]("<u4", "players")
    """(R, N): invalid attempts at turns (the paper's wrong actions)."""
    passes = Column[np.uint32]("<u4", "players")
    """(R, N): passes."""
    reward_sums = Column[np.float32]("<f4", "players")
    """(R, N): sum of each seat's rewards, including built-in agents."""
    performance = Column[np.float32]("<f4", "players")
    """(R, N): performance score, the running mean over the game's Shifts of 10 * points / pizzas."""


@dataclass(frozen=True, slots=True)
class Totals:
    """Counts since the stream began.

    Attributes:
        client_decisions: decisions taken by the client.
        decisions: decisions taken by all seats.
        invalid_attempts: invalid attempts of the client, at decisions of any kind.
        shifts: Shifts that have ended.
        games: games that have ended.
    """

    client_decisions: int
    decisions: int
    invalid_attempts: int
    shifts: int
    games: int
