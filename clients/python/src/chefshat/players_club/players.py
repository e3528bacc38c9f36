"""The processes of one player that plays in rooms one after the other, or in games of a tournament at the same time.

A player knows one game at a time. So there are as many processes as games at a time, and each goes from game to game, with what it
has learnt. One process is in `process`, one game in `agent`.
"""

import json
import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Self

from chefshat.decision import SeatInfo
from chefshat.players_club.agent import Counts, PlayersClubAgent
from chefshat.players_club.process import AgentLost, AgentProcess, AgentSpec

LOG = logging.getLogger("chefshat")

#: What stands for the number of a process in the arguments of its player and in the name of its log.
PROCESS = "{process}"


class Players:
    """The processes, started; a context manager. `seat` gives the agent of each game.

    Attributes:
        processes: all of them.
        counts: of all games so far.
        crowded: games that were begun when no process was free, with one that had a game already.
    """

    def __init__(self, spec: AgentSpec, games: int, *, attempts: int) -> None:
        """Names the player.

        Args:
            spec: the player. Where its arguments or its log say PROCESS, each process has its number there, from 0.
            games: games it is to play at a time, at least 1.
            attempts: how often an illegal choice is sent, see `PlayersClubAgent`.
        """
        self.processes = [AgentProcess(_numbered(spec, number)) for number in range(games)]
        self.counts = Counts()
        self.crowded = 0
        self._spec = spec
        self._attempts = attempts
        self._stack = ExitStack()
        self._closed = False
        # Who plays the latest game of each process.
        self._playing: dict[AgentProcess, PlayersClubAgent] = {}

    def __enter__(self) -> Self:
        """Starts all processes, side by side: some take long to load what they need. Raises AgentError if one cannot be started."""
        self._start(self.processes)
        return self

    def __exit__(self, *_: object) -> None:
        self._closed = True
        self._stack.close()

    def prepare(self, games: int) -> None:
        """Sees to it that there are processes for so many games at a time. Raises AgentError if one cannot be started."""
        more = [AgentProcess(_numbered(self._spec, number)) for number in range(len(self.processes), games)]
        if more:
            LOG.warning("processes are started for %d games at a time, not %d", games, len(self.processes))
            self._start(more)
            self.processes += more

    def _start(self, processes: Sequence[AgentProcess]) -> None:
        for process in processes:
            self._stack.callback(process.close)
        with ThreadPoolExecutor(len(processes)) as pool:
            try:
                if self._closed:
                    raise AgentLost("all is over already")
                list(pool.map(AgentProcess.start, processes))
            except BaseException:
                # Before the pool is waited for, which would wait until all others have been made.
                self._stack.close()
                raise

    @property
    def name(self) -> str:
        """What the player calls itself."""
        return self.processes[0].name

    @property
    def given_up(self) -> bool:
        """Whether a process is gone and will not be started again."""
        return any(process.given_up for process in self.processes)

    @property
    def restarts(self) -> int:
        """How often a process was started anew."""
        return sum(process.restarts for process in self.processes)

    def seat(self, seat: SeatInfo) -> PlayersClubAgent:
        """Seats a process that plays no game now, if need be one that has been given up."""
        playing = self._playing
        free = [process for process in self.processes if process not in playing or playing[process].over]
        if free:
            process = min(free, key=lambda process: process.given_up)
        else:
            # The server may have called the next game before it has said that one is over.
            process = next(iter(playing))
            self.crowded += 1
            LOG.warning("no process is free for the game in room %s: one that has a game already plays in it too", seat.room_id)
        # Those that have been playing for longest come first.
        playing.pop(process, None)
        playing[process] = agent = PlayersClubAgent(process, attempts=self._attempts, total=self.counts)
        return agent


def _numbered(spec: AgentSpec, number: int) -> AgentSpec:
    """The player of one process, which need not share files with those of the others."""
    arguments = json.loads(json.dumps(dict(spec.arguments)).replace(PROCESS, str(number)))
    log = spec.log and Path(str(spec.log).replace(PROCESS, str(number)))
    return replace(spec, arguments=arguments, log=log)
