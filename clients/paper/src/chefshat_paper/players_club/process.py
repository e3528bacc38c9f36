"""One agent in its own process: starting, calling and ending it, independent of the meaning of the calls.

A process that exceeds the time limit, dies or sends an invalid answer is killed; the next call restarts it, a bounded number of
times. `agent` takes the decisions that are lost. The other end of the pipes is `host`.
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

from chefshat.address import TOKEN
from chefshat.join_options import TICKET

LOG = logging.getLogger("chefshat")

HOST = Path(__file__).with_name("host.py")
# The call that creates the agent; all others are methods of it.
START = "start"
#: Maximum bytes of an answer.
MAX_ANSWER = 1 << 20
# Bytes of the agent's output to include in the error when it dies.
MAX_TAIL = 2000
# Seconds that a process has to end when its input is closed.
FAREWELL_S = 5.0


class AgentError(ChildProcessError):
    """A call of an agent failed. The message says how."""


class AgentRaised(AgentError):
    """The agent raised an exception. Its process continues."""


class AgentLost(AgentError):
    """The agent's process died, or was killed after a timeout or an invalid answer."""


@dataclass(frozen=True)
class AgentSpec:
    """The configuration of an agent.

    Attributes:
        agent: "module.path:Class".
        name: passed to the constructor as `name`, if it takes that.
        arguments: further arguments of the constructor, by name; JSON values.
        python: the Python with the agent's dependencies.
        paths: folders to search for its modules, before the working directory.
        start_limit_s: time limit for creating it (importing, loading or downloading models), in seconds.
        call_limit_s: time limit of one call, in seconds.
        restarts: maximum total number of restarts of its process.
        log: a file to append its output to; None: no file.
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
    """The process of one agent; a context manager. Not thread-safe, except for `close`."""

    def __init__(self, spec: AgentSpec) -> None:
        self.spec = spec
        #: The agent's own name, once it has been started.
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
        """Whether the process has ended and will not be restarted."""
        return self._closed or (self._started and self._running is None and self.restarts >= self.spec.restarts)

    def start(self) -> None:
        """Starts the process and waits until the agent is created. Does nothing if it is running.

        Raises:
            AgentError: the agent could not be created, or was given up.
        """
        if self._running is not None:
            return
        if self.given_up:
            raise AgentLost(f"{self.spec.agent} has been given up")
        if self._started:
            self.restarts += 1
            LOG.warning("restarting %s (%d of %d); its state is lost", self.spec.agent, self.restarts, self.spec.restarts)
        self._started = True
        spec = self.spec
        # Set before the agent is created, which may take long, so that `close` can end it.
        self._running = running = _Running(spec.python, spec.log)
        arguments = {"agent": spec.agent, "name": spec.name, "arguments": dict(spec.arguments), "paths": list(spec.paths)}
        try:
            if self._closed:
                raise AgentLost("it has been closed")
            started = running.call(START, arguments, spec.start_limit_s)
        except BaseException as error:
            self._running = None
            running.end()
            if isinstance(error, AgentError):
                raise type(error)(f"{spec.agent}: {error}") from error
            raise
        running.made = True
        self.name = str(started["name"]) if isinstance(started, dict) else spec.name

    def call(self, method: str, *arguments: object) -> object:
        """Calls a method of the agent and returns its answer. Restarts the process first if it has ended.

        Raises:
            AgentRaised: the method raised.
            AgentLost: the process has ended.
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
        """Ends the process: gracefully, or at once if the agent is still being created. Does nothing if it has ended."""
        self._closed = True
        running, self._running = self._running, None
        if running is None:
            return
        if running.made:
            running.leave()
        else:
            running.end()


class _Running:
    """A process and the two threads that read its output."""

    def __init__(self, python: str, log: Path | None) -> None:
        #: Whether the agent has been created.
        self.made = False
        self._calls = 0
        self._answers: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._tail = b""
        try:
            # In a session of its own it does not receive Ctrl-C, and its children can be killed with it.
            self._process = subprocess.Popen(
                [python, "-u", str(HOST)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                # The agent must not see the ticket.
                env={name: value for name, value in os.environ.items() if name not in (TICKET, TOKEN)},
            )
        except OSError as error:
            raise AgentLost(f"{python} cannot be started: {error.strerror or error}") from error
        self._readers = [
            threading.Thread(target=self._read_answers, args=(self._process.stdout,), daemon=True),
            threading.Thread(target=self._read_output, args=(self._process.stderr, log), daemon=True),
        ]
        self._is_killed = False
        for reader in self._readers:
            reader.start()

    def call(self, method: str, arguments: object, limit_s: float) -> object:
        """Sends one call and waits for its answer."""
        self._calls += 1
        what = "creating it" if method == START else method
        request = json.dumps({"id": self._calls, "call": method, "arguments": arguments})
        assert self._process.stdin is not None, "it is a pipe"
        try:
            # Does not block: there is one call at a time, and it fits into the pipe.
            self._process.stdin.write(request.encode() + b"\n")
            self._process.stdin.flush()
            line = self._answers.get(timeout=limit_s)
        except queue.Empty:
            raise AgentLost(f"{what} did not finish within {limit_s:g} s") from None
        except OSError:
            line = None
        if line is None:
            raise AgentLost(f"its process died in {what} ({self._how_it_died()})")
        try:
            answer = json.loads(line)
            if answer["id"] != self._calls:
                raise ValueError("the id of another call")
            if "error" not in answer:
                value: object = answer["value"]
                return value
            raised = AgentRaised(f"{what} raised {answer['error']}\n{answer['trace']}")
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise AgentLost(f"its process sent an invalid answer to {what}: {line[:80]!r} ({error})") from error
        raise raised

    def leave(self) -> None:
        """Closes the process's input, and kills the process if it does not end in time."""
        assert self._process.stdin is not None, "it is a pipe"
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(FAREWELL_S)
        self.end()

    def end(self) -> None:
        """Kills the process and its children."""
        self._kill()
        self._process.wait()
        for reader in self._readers:
            reader.join(FAREWELL_S)
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()

    def _kill(self) -> None:
        """Kills what is left of the process and its children, once: the id of their group may be another's later."""
        if self._is_killed:
            return
        self._is_killed = True
        with contextlib.suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()

    def _read_answers(self, pipe: IO[bytes]) -> None:
        with pipe:
            while line := pipe.readline(MAX_ANSWER):
                self._answers.put(line)
        self._answers.put(None)

    def _read_output(self, pipe: IO[bytes], log: Path | None) -> None:
        """Stores the last output of the agent. Reads it to its end, so that the agent does not block."""
        with contextlib.ExitStack() as stack:
            stack.enter_context(pipe)
            file = None
            if log is not None:
                try:
                    file = stack.enter_context(log.open("ab", buffering=0))
                except OSError as error:
                    LOG.warning("cannot log the agent's output: %s", error)
            while some := os.read(pipe.fileno(), 1 << 16):
                self._tail = (self._tail + some)[-MAX_TAIL:]
                if file is not None:
                    try:
                        file.write(some)
                    except OSError as error:
                        LOG.warning("the agent's output is no longer logged: %s", error)
                        file = None

    def _how_it_died(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(FAREWELL_S)
            # Its children would hold its output open.
            self._kill()
            self._readers[1].join(FAREWELL_S)
        code = self._process.returncode
        how = "it closed its output" if code is None else f"exit code {code}" if code >= 0 else f"signal {-code}"
        output = self._tail.decode(errors="replace").strip()
        return f"{how}; its last output:\n{output}" if output else f"{how}; it printed nothing"
