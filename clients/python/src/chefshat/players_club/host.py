"""What runs in an agent's own process and Python: makes the agent and calls its methods, as it is told over two pipes.

It is started as a file, in environments that know nothing of the package it comes with, so it uses the standard library alone. It
reads one JSON object a line, `{"id", "call", "arguments"}`, and answers with one, `{"id", "value"}` or `{"id", "error", "trace"}`.
The first call is "start". When to call what, and what to make of the answers, is decided on the other side (`process`, `agent`).
"""

from __future__ import annotations

import importlib
import inspect
import json
import os
import sys
import traceback
from collections.abc import Callable
from typing import Any, TextIO

# Calls of a traceback that are passed on: the last ones, which say where it happened.
LAST_FRAMES = 5
# What decides. An agent without one of these is no agent; whatever else it lacks is not called.
DECIDING = ("get_action", "get_exhanged_cards", "do_special_action")


def main() -> int:
    """Answers calls until there are no more."""
    requests, answers = take_pipes()
    # The folder of this file comes first in the search path of a script. What lies in it is not the agent's.
    del sys.path[0]
    agent: Any = None
    for line in requests:
        request = json.loads(line)
        answer = {"id": request["id"]}
        try:
            if request["call"] == "start":
                agent = make(**request["arguments"])
                value: object = {"name": name_of(agent, request["arguments"]["name"])}
            else:
                value = call(agent, request["call"], request["arguments"])
            text = json.dumps({**answer, "value": value}, default=plain)
        except (Exception, SystemExit) as error:
            said = "".join(traceback.format_exception_only(type(error), error)).strip()
            text = json.dumps({**answer, "error": said, "trace": traceback.format_exc(limit=-LAST_FRAMES, chain=False)})
        answers.write(text + "\n")
        answers.flush()
    return 0


def take_pipes() -> tuple[TextIO, TextIO]:
    """Takes standard input and output for the calls: what the agent prints goes to standard error, and it has nothing to read."""
    requests = os.fdopen(os.dup(0), "r", encoding="utf-8")
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    # The descriptor, not only Python's object: libraries in other languages print too.
    os.dup2(2, 1)
    return requests, answers


def make(agent: str, name: str, arguments: dict[str, Any], paths: list[str]) -> Any:  # noqa: ANN401
    """Makes the agent, an instance of "module.path:Class", with the arguments given, and `name` if its constructor takes it."""
    # What a Python started by hand has first: the folder it was started in.
    sys.path[:0] = [*paths, os.getcwd()]
    module, _, class_name = agent.partition(":")
    found = getattr(importlib.import_module(module), class_name)
    if not isinstance(found, type):
        raise TypeError(f"{agent} is no class")
    missing = [method for method in DECIDING if not callable(getattr(found, method, None))]
    if missing:
        raise TypeError(f"{agent} lacks {' and '.join(missing)}: it is no player of the second version")
    parameters = inspect.signature(found).parameters.values()
    takes_name = any(parameter.name == "name" or parameter.kind is parameter.VAR_KEYWORD for parameter in parameters)
    return found(**{**({"name": name} if takes_name else {}), **arguments})


def name_of(agent: object, given: str) -> str:
    """What the agent calls itself: it looks for this name among those of the players."""
    get_name = getattr(agent, "get_name", None)
    return str(get_name() if callable(get_name) else getattr(agent, "name", None) or given)


def call(agent: object, method: str, arguments: list[Any]) -> object:
    """Calls a method. One that only tells the agent something may be missing."""
    bound: Callable[..., object] | None = getattr(agent, method, None)
    if bound is None and method not in DECIDING:
        return None
    if method == "get_action":
        # Agents expect an array. One that has not loaded numpy cannot tell.
        numpy = sys.modules.get("numpy")
        if numpy is not None:
            arguments = [numpy.asarray(arguments[0], dtype="float32")]
    assert bound is not None, "it was looked for when the agent was made"
    value = bound(*arguments)
    # What is returned by methods that decide nothing is nobody's business, and need not be expressible.
    return value if method in DECIDING else None


def plain(value: Any) -> object:  # noqa: ANN401
    """Arrays, tensors and their numbers as lists and numbers."""
    if not hasattr(value, "tolist") and hasattr(value, "numpy"):
        value = value.numpy()
    if not hasattr(value, "tolist"):
        raise TypeError(f"the agent answered with {type(value).__name__}, which is neither numbers nor a list of them")
    listed: object = value.tolist()
    return listed


if __name__ == "__main__":
    sys.exit(main())
