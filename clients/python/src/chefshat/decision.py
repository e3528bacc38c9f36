"""A typed view of a decision request, and of the seat it is for.

The view adds names and numpy arrays to the message, but no rules: the server determines which actions are legal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.columns import NO_SEAT, Observations, Situations, Sizes
from chefshat.history import Entry, ShiftLog, entries
from chefshat.history import columns as history_columns

Counts: TypeAlias = NDArray[np.uint8]


class SeatInfo:
    """The seat of an agent.

    Attributes:
        room_id: 32 hexadecimal digits.
        game_id: 32 hexadecimal digits.
        seat: number of the seat, from 0.
        game_started: the start of the game (rule set, policy, participants, action space); None until the game has started.
        live_from: number of the next event when the seat was first attached: events with a lower number had happened before.
        shift_log: the events of the current Shift that the seat has seen.
    """

    __slots__ = ("game_id", "game_started", "live_from", "room_id", "seat", "shift_log")

    def __init__(self, room_id: str, game_id: str, seat: int, live_from: int = 0) -> None:
        self.room_id = room_id
        self.game_id = game_id
        self.seat = seat
        self.live_from = live_from
        self.game_started: pb.GameStarted | None = None
        self.shift_log = ShiftLog()

    def __repr__(self) -> str:
        return f"SeatInfo(room_id={self.room_id!r}, game_id={self.game_id!r}, seat={self.seat})"


class Decision:
    """A decision of a seat. Answer it with the index of any action in `legal_actions`.

    F is the number of faces (default 11), N the number of seats (default 4). Arrays of cards have F+1 counts: index f-1 counts
    face f, index F the jokers. Arrays of seats have one number per seat. All arrays are read-only views of the message's bytes.

    Attributes:
        request: the message.
        seat_info: the seat.
    """

    __slots__ = ("_attempts_left", "_log", "_seen", "annotations", "request", "seat_info")

    def __init__(self, request: pb.DecisionRequest, seat_info: SeatInfo, attempts_left: int | None = None) -> None:
        self.request = request
        self.seat_info = seat_info
        self.annotations: pb.Annotations | None = None
        self._attempts_left = attempts_left
        # The log grows while the agent decides; another one follows it if a Shift begins.
        self._log = seat_info.shift_log
        self._seen = len(self._log.events)
        self._log.asked(request)

    def __repr__(self) -> str:
        kind = pb.DecisionKind.Name(self.kind).removeprefix("DECISION_KIND_")
        return f"Decision(seat={self.seat_info.seat}, decision_id={self.decision_id}, kind={kind})"

    def annotate(
        self,
        *,
        value_estimate: float | None = None,
        action_scores: Sequence[float] = (),
        extra: Mapping[str, str] | None = None,
    ) -> None:
        """Annotates the answer. Annotations are recorded with it and hidden until the game has ended.

        Args:
            value_estimate: the agent's estimate of its position, in its own unit.
            action_scores: a score per action in the agent's own unit, index = action.
            extra: free keys and values.

        The limits are 4 KiB encoded for a decision and 256 KiB for a seat in a game; numbers must be finite. Annotations beyond
        them are dropped, which does not affect the answer: the first is logged, and all are counted in the result's
        `annotations_dropped`.
        """
        self.annotations = pb.Annotations(value_estimate=value_estimate, action_scores=action_scores, extra=extra or {})

    @property
    def decision_id(self) -> int:
        """Number of the decision: counts up by one per seat, from 1."""
        return self.request.decision_id

    @property
    def kind(self) -> pb.DecisionKind.ValueType:
        """Kind of the decision: `pb.DECISION_KIND_TURN`, `..._EXCHANGE` or `..._SPECIAL_ACTION`."""
        return self.request.kind

    @property
    def time_left_ms(self) -> int:
        """Milliseconds left before the time bank is used, when the server wrote the request."""
        return self.request.time_left_ms

    @property
    def bank_left_ms(self) -> int:
        """Milliseconds left in the seat's time bank, when the server wrote the request."""
        return self.request.bank_left_ms

    @property
    def invalid_attempts_left(self) -> int | None:
        """Invalid answers left before the server decides instead; None when unlimited."""
        if self._attempts_left is not None:
            return self._attempts_left
        return self.request.invalid_attempts_left if self.request.HasField("invalid_attempts_left") else None

    @property
    def seat(self) -> int:
        """The deciding seat, from 0."""
        return self.seat_info.seat

    @property
    def faces(self) -> int:
        """F, the number of faces in the deck: 4..=15, default 11."""
        return len(self.request.observation.hand) - 1

    @property
    def size(self) -> int:
        """Number of all actions, 3F(F+1)/2 + F + 5: 214 by default."""
        return self.turn_actions + self.faces + 3

    @property
    def turn_actions(self) -> int:
        """T, the number of actions of a turn, 3F(F+1)/2 + 2: 200 by default. They come first, and the last of them is passing."""
        faces = self.faces
        return 3 * faces * (faces + 1) // 2 + 2

    @property
    def mask_bytes(self) -> bytes:
        """The legal actions as sent: bit i%8 of byte i/8 is action i."""
        return self.request.action_mask

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Whether each action is legal: `size` booleans."""
        packed = np.frombuffer(self.request.action_mask, np.uint8)
        return np.unpackbits(packed, count=self.size, bitorder="little").view(np.bool_)

    @property
    def legal_actions(self) -> NDArray[np.intp]:
        """Indices of the legal actions, ascending; at least one."""
        return np.flatnonzero(self.mask)

    @property
    def play_requirement(self) -> pb.PlayRequirement | None:
        """At a turn: what a play must be, and whether passing is legal; None for other kinds."""
        return self.request.play_requirement if self.request.HasField("play_requirement") else None

    @property
    def gift_requirement(self) -> pb.GiftRequirement | None:
        """In the exchange: which card is due, and for whom; None for other kinds."""
        return self.request.gift_requirement if self.request.HasField("gift_requirement") else None

    @property
    def special_action(self) -> pb.SpecialAction.ValueType:
        """The special action that `declare` declares; `pb.SPECIAL_ACTION_UNSPECIFIED` for other kinds of decision."""
        return self.request.special_action

    @property
    def default_action(self) -> int:
        """Index of the action that the server takes when the time runs out or no invalid attempts are left. Always legal."""
        return self.request.default_action

    @property
    def shift(self) -> int:
        """The current Shift, from 1."""
        return self.request.observation.shift

    @property
    def pizza(self) -> int:
        """The current pizza of the Shift, from 1; 0 before the Shift's first turn."""
        return self.request.observation.pizza

    @property
    def hand(self) -> Counts:
        """The hand: F+1 counts."""
        return np.frombuffer(self.request.observation.hand, np.uint8)

    @property
    def golden(self) -> bool:
        """Whether the hand has the Golden card."""
        return self.request.observation.golden

    @property
    def board_face(self) -> int:
        """The face on the board: 0 empty, 1..F, F+1 for a joker played alone."""
        return self.request.observation.board_face

    @property
    def board_size(self) -> int:
        """Number of cards on the board, jokers included."""
        return self.request.observation.board_size

    @property
    def board_jokers(self) -> int:
        """Number of jokers among the cards on the board."""
        return self.request.observation.board_jokers

    @property
    def board_owner(self) -> int | None:
        """The seat that played the cards on the board; None if it is empty."""
        seen = self.request.observation
        return seen.board_owner if seen.HasField("board_owner") else None

    @property
    def cards_left(self) -> Counts:
        """Number of cards in each seat's hand: N numbers."""
        return np.frombuffer(self.request.observation.cards_left, np.uint8)

    @property
    def passed(self) -> Counts:
        """1 where a seat has passed and is out of the current pizza: N numbers, 0 or 1."""
        return np.frombuffer(self.request.observation.passed, np.uint8)

    @property
    def places(self) -> Counts:
        """Place of each seat that has finished this Shift, from 1, and 0 for the others: N numbers."""
        return np.frombuffer(self.request.observation.places, np.uint8)

    @property
    def roles(self) -> Counts:
        """Role of each seat: N values of `pb.Role`, all 0 in the first Shift."""
        return np.frombuffer(self.request.observation.roles, np.uint8)

    @property
    def points(self) -> NDArray[np.uint64]:
        """Points of each seat so far in the game: N numbers."""
        return np.array(self.request.observation.points, np.uint64)

    @property
    def played(self) -> Counts:
        """Cards played so far in this Shift by all seats: F+1 counts."""
        return np.frombuffer(self.request.observation.played, np.uint8)

    @property
    def gave(self) -> Counts:
        """Cards this seat gave in this Shift's exchange: F+1 counts; empty if it gave none."""
        return np.frombuffer(self.request.observation.gave, np.uint8)

    @property
    def received(self) -> Counts:
        """Cards this seat received in this Shift's exchange: F+1 counts; empty if it received none."""
        return np.frombuffer(self.request.observation.received, np.uint8)

    @property
    def hand_size(self) -> int:
        """H, the number of cards dealt to each seat: 17 by default. Raises ValueError before the start of the game has arrived."""
        return self.sizes.hand_size

    @property
    def sizes(self) -> Sizes:
        """The numbers that determine the widths of columns. Raises ValueError before the start of the game has arrived."""
        return Sizes.of(self._game_started())

    def _game_started(self) -> pb.GameStarted:
        if self.seat_info.game_started is None:
            raise ValueError("the number of cards dealt is unknown: the start of the game has not arrived")
        return self.seat_info.game_started

    @property
    def shift_events(self) -> list[pb.GameEvent]:
        """The events of the Shift that the seat had seen when it was asked, from `shift_started` on, without those of the room.

        They are the `events` of a `pb.Situation`. See `is_history_complete`.
        """
        return self._log.events[: self._seen]

    @property
    def is_history_complete(self) -> bool:
        """Whether the history begins with the Shift.

        It does, also after a reconnection or in a new process, because the server sends all events of the game again. It does not
        after a snapshot in mid-Shift.
        """
        return self._log.is_complete

    @property
    def history(self) -> list[Entry]:
        """The actions of the Shift, as far as the seat may know them. Raises ValueError before the start of the game has arrived.

        `chefshat.history` explains them. Two own gifts are in the order in which this process gave them; if it does not know the
        order, they are ascending.
        """
        return entries(self._log, self._seen, self.request, self.seat, self._game_started())

    def situations(self, history: int = 0) -> Situations:
        """Returns the decision as a table of one row, as a `VectorEnv`'s batch has it.

        Args:
            history: width of the column `history`, like that of the `VectorEnv`; 0: there is none.

        An observation function that works on `Situations`, such as `chefshat.learn.features.table_of`, takes both, so that a policy
        plays live as it was trained:

            scores = policy(table_of(decision.situations()))[0]
            action = np.where(decision.mask, scores, -np.inf).argmax()
        """
        seen, sizes = self.request.observation, replace(self.sizes, history=history)
        boards = [seen.board_face, seen.board_size, seen.board_jokers]
        columns: dict[str, NDArray[Any]] = {
            "shifts": np.array([seen.shift], np.uint32),
            "pizzas": np.array([seen.pizza], np.uint32),
            "golden": np.array([seen.golden], np.uint8),
            "boards": np.array([boards], np.uint8),
            "board_owners": np.array([seen.board_owner if seen.HasField("board_owner") else NO_SEAT], np.uint8),
            "points": np.minimum([seen.points], np.iinfo(np.uint32).max).astype(np.uint32),
        }
        for name in ("hands", "cards_left", "passed", "places", "roles", "played", "gave", "received"):
            sent = np.frombuffer(getattr(seen, "hand" if name == "hands" else name), np.uint8)
            # Nothing given or received is sent as no bytes.
            columns[name] = (sent if len(sent) else np.zeros(sizes.card_kinds, np.uint8))[np.newaxis]
        if history:
            columns["history"], columns["history_counts"] = history_columns(self.history, sizes)
        situations = Situations.of(
            1,
            sizes,
            {
                "seats": np.array([self.seat], np.uint8),
                "kinds": np.array([self.kind], np.uint8),
                "mask_bits": np.frombuffer(self.request.action_mask, np.uint8)[np.newaxis],
            },
        )
        situations.__dict__["observations"] = Observations.of(1, sizes, columns)
        return situations

    def situation(self) -> pb.Situation:
        """Returns all that the seat knows, as `AnalysisService.Evaluate` and `chefshat.search` take it.

        Raises ValueError before the start of the game, and if the start of the Shift is not known (`is_history_complete`).
        """
        if not self.is_history_complete:
            raise ValueError("what the seat knows is incomplete: the start of the Shift has not arrived")
        rules = self._game_started().rules
        return pb.Situation(rules=rules, seat=self.seat, decision=self.request, events=self.shift_events)

    def classic_vector(self) -> NDArray[np.float32]:
        """Computes the 228 numbers of the 2020 paper (F + H + T in general), each 0..=1.

        First the board, F slots: the cards of the play ascending with jokers as F+1, cut off after F slots; an empty board is F+2
        in the first slot; unused slots are 0. Then the hand, H slots, ascending, zeros first. Both are divided by F+2. Last the
        first T entries of the mask as 0 or 1. It hides what `chefshat.learn.features.classic` lists; `situations` hides nothing.
        """
        faces = self.faces
        joker = faces + 1
        dealt = self.hand_size
        vector = np.zeros(faces + dealt + self.turn_actions, np.float32)
        observation = self.request.observation
        face, size, jokers = observation.board_face, observation.board_size, observation.board_jokers
        board = [face] * (size - jokers) + [joker] * jokers if face else [faces + 2]
        board = board[:faces]
        vector[: len(board)] = board
        hand = np.repeat(np.arange(1, joker + 1), self.hand)
        if len(hand) > 0:
            vector[faces + dealt - len(hand) : faces + dealt] = hand
        vector[: faces + dealt] /= faces + 2
        vector[faces + dealt :] = self.mask[: self.turn_actions]
        return vector
