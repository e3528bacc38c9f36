"""One agent in a process and Python of its own: started, called, ended. Nothing here knows what the calls are about.

A process that does not answer in time, dies or answers nonsense is ended; the next call starts it anew, a bounded number of times.
What is decided in its place is for `agent` to say. The other end of the pipes is `host`.
"""

import contextlib
import json
import logging
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Self

from chefshat.join_options import TICKET

LOG = logging.getLogger("chefshat")

HOST = Path(__file__).with_name("host.py")
# The call that makes the agent; all others are methods of it.
START = "start"
#: Bytes of the longest answer that is read.
MAX_ANSWER = 1 << 20
# Bytes of the agent's own output that are kept for the message that it has died.
MAX_TAIL = 2000
# Seconds a process has to end when it is told that there is nothing more to do.
FAREWELL_S = 5.0


class AgentError(Exception):
    """An agent did not do what it was asked for. The message says what happened instead."""


class AgentRaised(AgentError):
    """Its code raised an exception. The process lives on."""


class AgentLost(AgentError):
    """Its process died, or was ended because it did not answer in time or answered nonsense."""


@dataclass(frozen=True)
class AgentSpec:
    """Which agent, and how it is made.

    Attributes:
        agent: "module.path:Class".
        name: given to the constructor as `name`, if it takes that.
        arguments: further arguments of the constructor, by name; whatever JSON can hold.
        python: the Python that has what the agent needs.
        paths: folders in which its modules are looked for first; then in the current one.
        start_limit_s: seconds it may take to be made: importing, loading models, downloading them.
        call_limit_s: seconds it may take over one call, before it counts as hanging.
        restarts: how often its process is started anew in all.
        log: a file to which what it prints is appended; nowhere if None.
    """

    agent: str
    name: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    python: str = sys.executable
    paths: tuple[str, ...] = ()
    start_limit_s: float = 120.0
    call_limit_s: float = 60.0
    restarts: int = 3
    log: Path | None = None


class AgentProcess:
    """Keeps one agent's process. One thread at a time calls it, but for `close`, which any thread may call. A context manager."""

    def __init__(self, spec: AgentSpec) -> None:
        self.spec = spec
        #: What the agent calls itself; known once it has been started.
        self.name = spec.name
        self.restarts = 0
        self._started = False
        self._closed = False
        self._running: _Running | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def given_up(self) -> bool:
        """Whether the process is gone and will not be started again."""
        return self._closed or (self._started and self._running is None and self.restarts >= self.spec.restarts)

    def start(self) -> None:
        """Starts the process and waits until the agent is made. Does nothing if it is there already.

        Raises:
            AgentError: it cannot be made, or may not be made again.
        """
        if self._running is not None:
            return
        if self.given_up:
            raise AgentLost(f"{self.spec.agent} has been given up")
        if self._started:
            self.restarts += 1
            LOG.warning(
                "%s is started anew (%d of %d); it knows nothing of before", self.spec.agent, self.restarts, self.spec.restarts
            )
        self._started = True
        spec = self.spec
        # Known before the agent is made, which may take long: `close` ends it in that too.
        self._running = running = _Running(spec.python, spec.log)
        arguments = {"agent": spec.agent, "name": spec.name, "arguments": dict(spec.arguments), "paths": list(spec.paths)}
        try:
            if self._closed:
                raise AgentLost("it has been closed")
            said = running.call(START, arguments, spec.start_limit_s)
        except BaseException as error:
            self._running = None
            running.end()
            if isinstance(error, AgentError):
                raise type(error)(f"{spec.agent}: {error}") from error
            raise
        running.made = True
        self.name = str(said["name"]) if isinstance(said, dict) else spec.name

    def call(self, method: str, *arguments: object) -> object:
        """Calls a method of the agent and returns its answer, starting the process anew first if it is gone.

        Raises:
            AgentRaised: the method raised.
            AgentLost: there is no process any more.
        """
        self.start()
        running = self._running
        if running is None:
            raise AgentLost(f"{self.spec.agent} has been closed")
        try:
            return running.call(method, arguments, self.spec.call_limit_s)
        except AgentLost:
            self._running = None
            running.end()
            raise

    def close(self) -> None:
        """Lets the process end by itself, or ends it: at once where the agent is still being made. More than once does no harm."""
        self._closed = True
        running, self._running = self._running, None
        if running is None:
            return
        if running.made:
            running.leave()
        else:
            running.end()


class _Running:
    """A process and the two threads that read what it writes."""

    def __init__(self, python: str, log: Path | None) -> None:
        #: Whether it has made its agent.
        self.made = False
        self._calls = 0
        self._answers: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._tail = b""
        try:
            # A session of its own: Ctrl-C is for the program that plays, and what the agent itself has started ends with it.
            self._process = subprocess.Popen(
                [python, "-u", str(HOST)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                # The place is the command's: what the agent brings along need not know how to take it.
                env={name: value for name, value in os.environ.items() if name != TICKET},
            )
        except OSError as error:
            raise AgentLost(f"{python} cannot be started: {error.strerror or error}") from error
        self._readers = [
            threading.Thread(target=self._read_answers, args=(self._process.stdout,), daemon=True),
            threading.Thread(target=self._read_output, args=(self._process.stderr, log), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def call(self, method: str, arguments: object, limit_s: float) -> object:
        """Sends one call and waits for its answer."""
        self._calls += 1
        what = "making it" if method == START else method
        request = json.dumps({"id": self._calls, "call": method, "arguments": arguments})
        assert self._process.stdin is not None, "it was asked for"
        try:
            # At most one call is under way, and each fits into the pipe: nobody waits here.
            self._process.stdin.write(request.encode() + b"\n")
            self._process.stdin.flush()
            line = self._answers.get(timeout=limit_s)
        except queue.Empty:
            raise AgentLost(f"{what} did not return within {limit_s:g} s") from None
        except OSError:
            line = None
        if line is None:
            raise AgentLost(f"its process died in {what} ({self._how_it_died()})")
        try:
            answer = json.loads(line)
            if answer["id"] != self._calls:
                raise ValueError("the number of another call")
            if "error" not in answer:
                value: object = answer["value"]
                return value
            raised = AgentRaised(f"{what} raised {answer['error']}\n{answer['trace']}")
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise AgentLost(f"its process answered {what} with nonsense: {line[:80]!r} ({error})") from error
        raise raised

    def leave(self) -> None:
        """Tells the process that there is nothing more to do, and ends it if it takes long over that."""
        assert self._process.stdin is not None, "it was asked for"
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(FAREWELL_S)
        self.end()

    def end(self) -> None:
        """Ends the process and everything it has started."""
        # Once it has gone and been waited for, its number may be somebody else's.
        if self._process.poll() is None:
            with contextlib.suppress(OSError):
                if hasattr(os, "killpg"):
                    os.killpg(self._process.pid, signal.SIGKILL)
                else:
                    self._process.kill()
            self._process.wait()
        for reader in self._readers:
            reader.join(FAREWELL_S)
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()

    def _read_answers(self, pipe: IO[bytes]) -> None:
        with pipe:
            while line := pipe.readline(MAX_ANSWER):
                self._answers.put(line)
        self._answers.put(None)

    def _read_output(self, pipe: IO[bytes], log: Path | None) -> None:
        """Keeps the last of what the agent prints. It must be read to its end, or the agent would wait."""
        with contextlib.ExitStack() as stack:
            stack.enter_context(pipe)
            kept = None
            if log is not None:
                try:
                    kept = stack.enter_context(log.open("ab", buffering=0))
                except OSError as error:
                    LOG.warning("what the agent prints is not kept: %s", error)
            while some := os.read(pipe.fileno(), 1 << 16):
                self._tail = (self._tail + some)[-MAX_TAIL:]
                if kept is not None:
                    kept.write(some)

    def _how_it_died(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(FAREWELL_S)
            # Its output ends with it, unless it has left somebody behind who still may print.
            self._readers[1].join(FAREWELL_S)
        code = self._process.returncode
        how = "it closed its output" if code is None else f"exit code {code}" if code >= 0 else f"signal {-code}"
        said = self._tail.decode(errors="replace").strip()
        return f"{how}; it last printed:\n{said}" if said else f"{how}; it printed nothing"
