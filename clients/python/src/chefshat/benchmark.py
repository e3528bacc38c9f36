"""The benchmark ChefsHat-v1 (docs/benchmark.md): plays the games that `chefshat bench run` hands out.

    class Mine(Agent):
        def decide(self, decision):
            ...

    benchmark.play(Mine)

in `agent.py` is an entrant: `chefshat bench run shift --out results/mine --name mine -- python agent.py`.
"""

import asyncio
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress

from chefshat.agents import Agent
from chefshat.aio import Client
from chefshat.errors import first_error


def play(make_agent: Callable[[], Agent], *, games: Iterable[str] | None = None) -> int:
    """Plays games until there are no more: as many at a time as are given, in one event loop.

    Args:
        make_agent: makes the agent of a game, for example its class.
        games: a line for each game, the server's address, a join code and the agent's name, separated by spaces; None: standard
            input. A token and a certificate authority come from CHEFSHAT_TOKEN and CHEFSHAT_CA.

    Returns:
        The number of games.

    Raises:
        ChefsHatError: a game could not be joined or played to its end. What an agent raises is passed on.
        ValueError: a line is not a game.
    """
    return asyncio.run(_play(make_agent, sys.stdin if games is None else games))


async def _play(make_agent: Callable[[], Agent], games: Iterable[str]) -> int:
    # None after the last line; an exception where reading failed.
    lines: asyncio.Queue[str | Exception | None] = asyncio.Queue()
    loop = asyncio.get_running_loop()

    def put(line: str | Exception | None) -> None:
        # After a game has failed the loop is closed.
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(lines.put_nowait, line)

    def read() -> None:
        try:
            for line in games:
                put(line)
        except Exception as error:
            put(error)
        else:
            put(None)

    # A daemon: the command may wait for this process before it closes its standard input.
    threading.Thread(target=read, daemon=True).start()
    clients: dict[str, Client] = {}
    played = 0
    try:
        with first_error():
            async with asyncio.TaskGroup() as group:
                while (line := await lines.get()) is not None:
                    if isinstance(line, Exception):
                        raise line
                    address, code, name = _game(line)
                    if address not in clients:
                        clients[address] = Client(address)
                    group.create_task(_play_one(clients[address], make_agent(), code, name))
                    played += 1
    finally:
        for client in clients.values():
            await client.close()
    return played


def _game(line: str) -> tuple[str, str, str]:
    """Reads the address and the join code of a game, and the agent's name."""
    words = line.strip().split(" ", 2)
    if len(words) != 3:
        raise ValueError(
            f"{line!r} is not an address, a join code and a name, as `chefshat bench run` writes them to standard input"
        )
    return words[0], words[1], words[2]


async def _play_one(client: Client, agent: Agent, code: str, name: str) -> None:
    joined = await client.rooms.join(code, name)
    await client.play(agent, joined.ticket)
