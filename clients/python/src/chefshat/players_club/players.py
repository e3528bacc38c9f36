"""The processes of one player that plays in rooms one after the other, or in games of a tournament at the same time.

A player knows one game at a time. So there are as many processes as games at a time, and each goes from game to game, with what it
has learnt. One process is in `process`, one game in `agent`.
"""

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from typing import Self

from chefshat.decision import SeatInfo
from chefshat.players_club.agent import PlayersClubAgent
from chefshat.players_club.process import AgentProcess, AgentSpec


class Players:
    """The processes, started; a context manager. `seat` gives the agent of each game.

    Attributes:
        processes: all of them.
        agents: the agent of every game so far, in the order in which the games were begun.
    """

    def __init__(self, spec: AgentSpec, games: int, *, attempts: int) -> None:
        """Names the player.

        Args:
            spec: the player.
            games: games it is to play at a time, at least 1.
            attempts: how often an illegal choice is sent, see `PlayersClubAgent`.
        """
        self.processes = [AgentProcess(spec) for _ in range(games)]
        self.agents: list[PlayersClubAgent] = []
        self._attempts = attempts
        # Who plays the latest game of each process.
        self._playing: dict[AgentProcess, PlayersClubAgent] = {}

    def __enter__(self) -> Self:
        """Starts all processes, side by side: some take long to load what they need. Raises AgentError if one cannot be started."""
        with ExitStack() as stack:
            for process in self.processes:
                stack.callback(process.close)
            with ThreadPoolExecutor(len(self.processes)) as pool:
                list(pool.map(AgentProcess.start, self.processes))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

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
        """Seats a process that plays no game now."""
        playing = self._playing
        free = [process for process in self.processes if process not in playing or playing[process].over]
        # The server may call the next game before it has said that one is over, or a seat may have been lost. Then it is most
        # likely the game that was begun first.
        process = free[0] if free else next(iter(playing))
        playing.pop(process, None)
        playing[process] = agent = PlayersClubAgent(process, attempts=self._attempts)
        self.agents.append(agent)
        return agent
