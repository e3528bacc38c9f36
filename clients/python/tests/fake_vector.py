"""A fake `VectorService` with a toy game. Its numbers encode their position, so that swapped columns are detected.

In game g the seats decide in turn, starting with seat g mod N. The legal actions of decision t of an episode are t and 199. An
episode has 5 + g mod 3 decisions. The reward of decision t is t+1, of an invalid attempt -1, and of the end 100 + seat.
"""

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from typing import Self

import grpc
import numpy as np
from refusing import Context, refuse

from chefshat import pb
from chefshat._gen.chefshat.v1 import vector_service_pb2_grpc as vector_grpc

FACES = 11
PLAYERS = 4
ACTIONS = 214
TURN_ACTIONS = 200
HAND_SIZE = 17
# Episodes per game.
EPISODES = 2


def observation(game: int, seat: int, decision: int, episode: int) -> dict[str, list[int]]:
    """Returns the observation of a seat before a decision, as one row of each column."""
    return {
        "shifts": [episode],
        "pizzas": [decision],
        "hands": [game, seat, decision, *[1] * (FACES - 2)],
        "golden": [seat % 2],
        "boards": [decision % 13, 1, 0],
        "board_owners": [decision % PLAYERS],
        "cards_left": [17 - decision] * PLAYERS,
        "passed": [0] * PLAYERS,
        "places": [0] * PLAYERS,
        "roles": [1, 2, 4, 5],
        "points": [1000 * game + other for other in range(PLAYERS)],
        "played": [decision] * (FACES + 1),
        "gave": [seat] * (FACES + 1),
        "received": [game] * (FACES + 1),
    }


def column(values: Sequence[Sequence[int] | float], dtype: str) -> bytes:
    """Encodes a column."""
    return np.array(values, dtype).tobytes()


def observation_columns(rows: list[dict[str, list[int]]]) -> pb.ObservationColumns:
    """Encodes rows as columns."""
    wide = {"shifts": "<u4", "pizzas": "<u4", "points": "<u4"}
    if not rows:
        return pb.ObservationColumns()
    return pb.ObservationColumns(**{name: column([row[name] for row in rows], wide.get(name, "u1")) for name in rows[0]})


class ToyGame:
    """A game."""

    def __init__(self, number: int, seats: list[int]) -> None:
        self.number = number
        self.seats = seats
        self.begun = 0
        self.begin()

    def begin(self) -> None:
        self.begun += 1
        self.episode = 1
        self.begin_episode()

    def begin_episode(self) -> None:
        self.decision = 0
        self.attempts = 0
        self.owed = dict.fromkeys(range(PLAYERS), 0.0)
        self.skip()

    @property
    def seat(self) -> int:
        """The deciding seat."""
        return (self.number + self.decision) % PLAYERS

    @property
    def length(self) -> int:
        """Decisions per episode."""
        return 5 + self.number % 3

    def skip(self) -> None:
        """Takes the decisions of seats that are not the client's."""
        while self.decision < self.length and self.seat not in self.seats:
            self.owed[self.seat] += self.decision + 1
            self.decision += 1

    def decide(self, action: int, again: bool) -> list[tuple[int, ...]]:
        """Takes a decision; returns the endings (game, seat, reward, end, game over, place, decision, episode)."""
        if action not in (self.decision, 199):
            assert again
            self.owed[self.seat] -= 1
            self.attempts += 1
            return []
        self.owed[self.seat] += self.decision + 1
        self.attempts = 0
        self.decision += 1
        self.skip()
        if self.decision < self.length:
            return []
        over = self.episode == EPISODES
        # Odd games are truncated, without places.
        cut_off = self.number % 2
        end = pb.EPISODE_END_CUT_SHORT if cut_off else pb.EPISODE_END_FINISHED
        endings: list[tuple[int, ...]] = [
            (
                self.number,
                seat,
                int(self.owed[seat] + 100 + seat),
                end,
                int(over),
                0 if cut_off else seat + 1,
                self.decision,
                self.episode,
            )
            for seat in self.seats
        ]
        if over:
            self.begin()
        else:
            self.episode += 1
            self.begin_episode()
        return endings


class ToyStream:
    """All games of one stream."""

    def __init__(self, setup: pb.VectorSetup) -> None:
        self.setup = setup
        self.seats = list(setup.client_seats) or list(range(PLAYERS))
        self.games = [ToyGame(number, self.seats) for number in range(setup.games)]
        self.step = 0
        self.endings: list[tuple[int, ...]] = []
        self.began = list(range(setup.games))
        self.ended = 0
        self.shifts = 0

    def start(self) -> Iterator[pb.RunResponse]:
        """Returns the first two messages."""
        rules = pb.RuleSet(players=PLAYERS, faces=FACES, jokers=2, target_points=15)
        space = pb.ActionSpace(id="chefshat-11", size=ACTIONS, turn_actions=TURN_ACTIONS)
        agents = ["" if seat in self.seats else "random" for seat in range(PLAYERS)]
        yield pb.RunResponse(
            started=pb.VectorStarted(
                rules=rules,
                action_space=space,
                hand_size=HAND_SIZE,
                client_seats=self.seats,
                built_in_agents=agents,
                base_seed=None if self.setup.HasField("game_seeds") else self.setup.base_seed,
            )
        )
        yield self.batch()

    def answer(self, request: pb.RunRequest, context: Context) -> Iterator[pb.RunResponse]:
        """Returns the batch after a request, preceded by the records of games that have ended."""
        self.endings, self.began = [], []
        if request.HasField("restore"):
            refuse(context, grpc.StatusCode.INVALID_ARGUMENT, "STATES_REFUSED", "these bytes are not a state")
        elif request.HasField("reset"):
            named = np.frombuffer(request.reset.games, "<u4").tolist()
            chosen = range(len(self.games)) if request.reset.all else named
            for game in chosen:
                self.games[game].begin()
                self.began.append(game)
        else:
            actions = np.frombuffer(request.actions.actions, "<u2").tolist()
            if len(actions) != len(self.games):
                refuse(context, grpc.StatusCode.INVALID_ARGUMENT, "ACTIONS_REFUSED", "one action for each row is wanted")
            again = self.setup.invalid_actions == pb.INVALID_ACTION_RULE_ASK_AGAIN
            for game, action in zip(self.games, actions, strict=True):
                before = game.begun
                self.endings += game.decide(action, again)
                if game.begun > before:
                    self.began.append(game.number)
                    if self.setup.records:
                        yield from self.record(game)
        yield self.batch()

    def record(self, game: ToyGame) -> Iterator[pb.RunResponse]:
        """Returns a record in two parts."""
        header = pb.RecordLine(header=pb.RecordHeader(game_id=f"{game.number}"))
        footer = pb.RecordLine(footer=pb.RecordFooter(events=game.begun))
        yield pb.RunResponse(record=pb.VectorRecord(game=game.number, index=7, lines=[header]))
        yield pb.RunResponse(record=pb.VectorRecord(game=game.number, index=7, lines=[footer], last=True))

    def batch(self) -> pb.RunResponse:
        """Returns the current batch."""
        self.step += 1
        games, endings = self.games, self.endings
        masks = np.zeros((len(games), ACTIONS), np.bool_)
        for row, game in enumerate(games):
            masks[row, [game.decision, 199]] = True
        rewards = []
        for game in games:
            rewards.append(game.owed[game.seat])
            game.owed[game.seat] = 0.0
        self.ended += len(self.began) if self.step > 1 else 0
        self.shifts += len(endings) // len(self.seats)
        batch = pb.VectorBatch(
            step=self.step,
            rows=len(games),
            games=column([game.number for game in games], "<u4"),
            seats=column([game.seat for game in games], "u1"),
            kinds=column([pb.DECISION_KIND_TURN] * len(games), "u1"),
            attempts=column([game.attempts for game in games], "<u4"),
            rewards=column(rewards, "<f4"),
            observations=observation_columns([observation(g.number, g.seat, g.decision, g.episode) for g in games]),
            action_masks=np.packbits(masks, axis=1, bitorder="little").tobytes(),
            endings=pb.EpisodeEndings(
                rows=len(endings),
                games=column([one[0] for one in endings], "<u4"),
                seats=column([one[1] for one in endings], "u1"),
                rewards=column([one[2] for one in endings], "<f4"),
                ends=column([one[3] for one in endings], "u1"),
                game_over=column([one[4] for one in endings], "u1"),
                places_taken=column([one[5] for one in endings], "u1"),
                observations=observation_columns([observation(one[0], one[1], one[6], one[7]) for one in endings]),
            ),
            beginnings=pb.GameBeginnings(
                rows=len(self.began),
                games=column(self.began, "<u4"),
                indices=column([self.games[game].begun - 1 for game in self.began], "<u8"),
                seeds=column([[game] * 32 for game in self.began], "u1"),
            ),
            totals=pb.VectorTotals(client_decisions=self.step - 1, shifts=self.shifts, games=self.ended),
        )
        return pb.RunResponse(batch=batch)


class ToyVector(vector_grpc.VectorServiceServicer):
    """The service. `spoil` may change its messages."""

    def __init__(self) -> None:
        self.setups: list[pb.VectorSetup] = []
        self.requests: list[pb.RunRequest] = []
        self.spoil: Callable[[pb.RunResponse], Iterable[pb.RunResponse]] = lambda response: [response]
        #: Set when a stream has ended.
        self.ended = threading.Event()

    def Run(self, request_iterator: Iterator[pb.RunRequest], context: Context) -> Iterator[pb.RunResponse]:
        context.add_callback(self.ended.set)
        setup = next(request_iterator).setup
        self.setups.append(setup)
        if setup.games == 0:
            refuse(context, grpc.StatusCode.INVALID_ARGUMENT, "SETUP_REFUSED", "give at least one game", field="games")
        stream = ToyStream(setup)
        for response in stream.start():
            yield from self.spoil(response)
        for request in request_iterator:
            self.requests.append(request)
            for response in stream.answer(request, context):
                yield from self.spoil(response)


class FakeVector(ToyVector):
    """A server with only this service; a context manager."""

    def __init__(self) -> None:
        super().__init__()
        self._server = grpc.server(futures.ThreadPoolExecutor(max_workers=8))
        vector_grpc.add_VectorServiceServicer_to_server(self, self._server)
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop(grace=None).wait()
