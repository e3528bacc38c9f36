"""The processes of one player that plays in rooms one after another, or in several games of a tournament at a time.

A player plays one game at a time. So there are as many processes as parallel games, and each plays game after game with its learned
state. One process is in `process`, one game in `agent`.
"""

import json
import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Self

from chefshat_paper.players_club.agent import Counts, PlayersClubAgent
from chefshat_paper.players_club.process import AgentLost, AgentProcess, AgentSpec

LOG = logging.getLogger("chefshat")

#: Placeholder for the number of a process in the arguments of its player and in the name of its log.
PROCESS = "{process}"


class Players:
    """The started processes; a context manager. `agent` creates the agent of each game.

    Attributes:
        processes: all processes.
        counts: of all games so far.
        crowded: games that were started with a busy process, because none was free.
    """

    def __init__(self, spec: AgentSpec, games: int, *, attempts: int) -> None:
        """Configures the player.

        Args:
            spec: the player. PROCESS in its arguments or its log is replaced by the number of each process, from 0.
            games: games to play at a time, at least 1.
            attempts: illegal choices to send, see `PlayersClubAgent`.
        """
        self.processes = [AgentProcess(_numbered(spec, number)) for number in range(games)]
        self.counts = Counts()
        self.crowded = 0
        self._spec = spec
        self._attempts = attempts
        self._stack = ExitStack()
        self._closed = False
        # The agent of the latest game of each process.
        self._playing: dict[AgentProcess, PlayersClubAgent] = {}

    def __enter__(self) -> Self:
        """Starts all processes in parallel, since some load for long. Raises AgentError if one cannot be started."""
        self._start(self.processes)
        return self

    def __exit__(self, *_: object) -> None:
        self._closed = True
        self._stack.close()

    def prepare(self, games: int) -> None:
        """Starts further processes for `games` games at a time. Raises AgentError if one cannot be started."""
        more = [AgentProcess(_numbered(self._spec, number)) for number in range(len(self.processes), games)]
        if more:
            LOG.warning("starting processes for %d games at a time instead of %d", games, len(self.processes))
            self._start(more)
            self.processes += more

    def _start(self, processes: Sequence[AgentProcess]) -> None:
        for process in processes:
            self._stack.callback(process.close)
        with ThreadPoolExecutor(len(processes)) as pool:
            try:
                if self._closed:
                    raise AgentLost("the players are closed")
                list(pool.map(AgentProcess.start, processes))
            except BaseException:
                # Before leaving the pool, which waits until all others have started.
                self._stack.close()
                raise

    @property
    def name(self) -> str:
        """The player's own name."""
        return self.processes[0].name

    @property
    def given_up(self) -> bool:
        """Whether a process has ended and will not be restarted."""
        return any(process.given_up for process in self.processes)

    @property
    def restarts(self) -> int:
        """Number of restarts of all processes."""
        return sum(process.restarts for process in self.processes)

    def agent(self) -> PlayersClubAgent:
        """Creates the agent of a game, with a free process, preferably one that has not been given up."""
        playing = self._playing
        free = [process for process in self.processes if process not in playing or playing[process].over]
        if free:
            process = min(free, key=lambda process: process.given_up)
        else:
            # The next game may begin before the end of the last one arrives.
            process = next(iter(playing))
            self.crowded += 1
            LOG.warning("no process is free for another game: assigning a busy one")
        # Ordered by the start of the latest game.
        playing.pop(process, None)
        playing[process] = agent = PlayersClubAgent(process, attempts=self._attempts, total=self.counts)
        return agent


def _numbered(spec: AgentSpec, number: int) -> AgentSpec:
    """Returns the spec of one process, with its number."""
    arguments = json.loads(json.dumps(dict(spec.arguments)).replace(PROCESS, str(number)))
    log = spec.log and Path(str(spec.log).replace(PROCESS, str(number)))
    return replace(spec, arguments=arguments, log=log)
