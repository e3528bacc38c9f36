"""`chefshat mcp` and the Python SDK of the Model Context Protocol: games over both transports, with and without a handshake."""

import asyncio
import os
import re
import subprocess
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import pytest
from mcp import Client, StdioServerParameters, types
from mcp.client.stdio import stdio_client

import chefshat
from chefshat import pb

pytestmark = pytest.mark.server

SEATS = [None, "greedy", "random", "greedy"]
# Nobody has to hurry.
POLICY = pb.RoomPolicy(decision_time_ms=3_600_000, pace_ms=0)
# The client asks for the revision, begins with the current one, or with a handshake.
MODES = ["auto", "2026-07-28", "legacy"]


class Table:
    """A seat, played with the tools of a client."""

    def __init__(self, client: Client) -> None:
        self.client = client
        # The handle of the table; None: the only one.
        self.handle: str | None = None
        self.played = 0

    async def call(self, tool: str, **arguments: object) -> tuple[str, bool]:
        """Calls a tool; returns its text, and whether that is an error."""
        if self.handle is not None:
            arguments["table"] = self.handle
        result = await self.client.call_tool(tool, arguments)
        (content,) = result.content
        assert isinstance(content, types.TextContent)
        return content.text, bool(result.is_error)

    async def say(self, tool: str, **arguments: object) -> str:
        """Calls a tool that succeeds."""
        text, is_error = await self.call(tool, **arguments)
        assert not is_error, text
        return text

    async def play(self) -> str:
        """Plays to the end of the game; returns its id."""
        text = await self.say("wait_for_turn", after_sequence=0)
        while "The game is over." not in text:
            open_decision = re.search(r"^decision (\d+):", text, re.MULTILINE)
            if open_decision is None:
                text = await self.say("wait_for_turn")
                continue
            decision = int(open_decision[1])
            options = re.findall(r"^(a\d+)=(.+)$", text, re.MULTILINE)
            assert options, text
            if self.played == 0:
                refused, is_error = await self.call("play", decision=decision, action="a9999")
                assert is_error
                assert re.findall(r"^(a\d+)=(.+)$", refused, re.MULTILINE) == options
            action, words = options[-1]
            text = await self.say("play", decision=decision, action=action, reason=f"why not {words}", wait=True)
            self.played += 1
        record = re.search(r"chefshat://records/([0-9a-f]{32})", text)
        assert record is not None, text
        return record[1]


async def plays_a_game(client: Client, address: str, *, by_handle: bool) -> None:
    """Joins a room, plays its game, and reads what is to be read then."""
    table = Table(client)
    async with chefshat.aio.Client(address) as host:
        room = await host.rooms.create("models", seats=SEATS, policy=POLICY)
        assert "models: waiting, 1 of 4 seats free" in await table.say("list_rooms")
        joined = await table.say("join_room", join_code=room.join_code, name="Ada")
        handle = joined.splitlines()[0].removeprefix("table ")
        if by_handle:
            assert (await table.call("get_table"))[1], "several clients may share the server: the handle says who asks"
            table.handle = handle
        game_id = await table.play()
        assert game_id == room.room.game_id
        assert table.played > 0
        for uri in (f"chefshat://records/{game_id}", f"chefshat://tables/{handle}/events", "chefshat://rules"):
            (contents,) = (await client.read_resource(uri)).contents
            assert isinstance(contents, types.TextResourceContents)
            assert contents.text
            assert ("why not" in contents.text) == ("records" in uri)
        assert (await host.rooms.get(room.room.room_id)).state == pb.ROOM_STATE_FINISHED
        assert [prompt.name for prompt in (await client.list_prompts()).prompts] == ["play"]
        assert await table.say("leave") == "You have left the table."


@asynccontextmanager
async def over_stdio(binary: Path, address: str, mode: str) -> AsyncIterator[Client]:
    """A client that starts the program."""
    server = StdioServerParameters(command=str(binary), args=["mcp", "--server", f"http://{address}"])
    async with Client(stdio_client(server), mode=mode) as client:
        yield client


@contextmanager
def listening(binary: Path, address: str) -> Iterator[str]:
    """The program serving HTTP; yields the URL of its endpoint."""
    command = [str(binary), "mcp", "--server", f"http://{address}", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ) as program:
        try:
            assert program.stdout is not None
            yield program.stdout.readline().removeprefix("listening on ").strip()
        finally:
            program.terminate()
    assert program.returncode == 0


@pytest.mark.parametrize("mode", MODES)
async def test_a_model_plays_a_game_over_standard_input_and_output(real_binary: Path, real_address: str, mode: str) -> None:
    async with over_stdio(real_binary, real_address, mode) as client:
        assert (client.protocol_version == "2026-07-28") == (mode != "legacy")
        assert ("Chef's Hat" in (client.instructions or "")) == (mode != "2026-07-28")
        await plays_a_game(client, real_address, by_handle=False)


@pytest.mark.parametrize("mode", MODES)
def test_a_model_plays_a_game_over_http(real_binary: Path, real_address: str, mode: str) -> None:
    async def run(url: str) -> None:
        async with Client(url, mode=mode) as client:
            await plays_a_game(client, real_address, by_handle=True)

    with listening(real_binary, real_address) as url:
        asyncio.run(run(url))
