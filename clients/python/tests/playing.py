"""Games of several seats with each of the two clients. Contains no tests."""

import asyncio
from collections.abc import Mapping
from typing import Protocol

import chefshat
from chefshat import Agent, Backoff, SeatResult, aio

Results = dict[str, SeatResult]
QUICK = Backoff(first_s=0.001, max_s=0.01)


class Player(Protocol):
    """Either of them."""

    def __call__(self, address: str, agents: Mapping[str, Agent], backoff: Backoff = QUICK) -> Results: ...


def play_blocking(address: str, agents: Mapping[str, Agent], backoff: Backoff = QUICK) -> Results:
    with chefshat.Client(address, backoff=backoff) as client:
        return client.play_many(agents)


def play_asyncio(address: str, agents: Mapping[str, Agent], backoff: Backoff = QUICK) -> Results:
    async def run() -> Results:
        async with aio.Client(address, backoff=backoff) as client:
            return await client.play_many(agents)

    return asyncio.run(run())
