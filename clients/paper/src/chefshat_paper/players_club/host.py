"""The program in an agent's process: creates the agent and calls its methods, on requests over a pipe.

It runs as a file, in environments without this package, so it uses only the standard library. It reads one JSON object per line,
`{"id", "call", "arguments"}`, and answers with `{"id", "value"}` or `{"id", "error", "trace"}`. The first call is "start".
`process` makes the calls.
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

# Frames of a traceback to pass on: the last ones.
LAST_FRAMES = 5
# Required methods of an agent. Other methods are optional.
DECIDING = ("get_action", "get_exhanged_cards", "do_special_action")


def main() -> int:
    """Answers calls until there are no more."""
    requests, answers = take_pipes()
    # The folder of this file, first in a script's search path, must not shadow the agent's modules.
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
            message = "".join(traceback.format_exception_only(type(error), error)).strip()
            text = json.dumps({**answer, "error": message, "trace": traceback.format_exc(limit=-LAST_FRAMES, chain=False)})
        answers.write(text + "\n")
        answers.flush()
    return 0


def take_pipes() -> tuple[TextIO, TextIO]:
    """Reserves standard input and output for the calls. Output of the agent goes to standard error; its input is empty."""
    requests = os.fdopen(os.dup(0), "r", encoding="utf-8")
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    # Replaces the descriptor, since libraries in other languages print, too.
    os.dup2(2, 1)
    return requests, answers


def make(agent: str, name: str, arguments: dict[str, Any], paths: list[str]) -> Any:  # noqa: ANN401
    """Creates the agent, an instance of "module.path:Class", with the arguments, and with `name` if its constructor takes it."""
    # An interactive Python searches the working directory first.
    sys.path[:0] = [*paths, os.getcwd()]
    module, _, class_name = agent.partition(":")
    found = getattr(importlib.import_module(module), class_name)
    if not isinstance(found, type):
        raise TypeError(f"{agent} is not a class")
    missing = [method for method in DECIDING if not callable(getattr(found, method, None))]
    if missing:
        raise TypeError(f"{agent} lacks {' and '.join(missing)}: it is not a player of the second version")
    parameters = inspect.signature(found).parameters.values()
    takes_name = any(parameter.name == "name" or parameter.kind is parameter.VAR_KEYWORD for parameter in parameters)
    return found(**{**({"name": name} if takes_name else {}), **arguments})


def name_of(agent: object, given: str) -> str:
    """Returns the agent's own name, by which it identifies itself among the players."""
    get_name = getattr(agent, "get_name", None)
    return str(get_name() if callable(get_name) else getattr(agent, "name", None) or given)


def call(agent: object, method: str, arguments: list[Any]) -> object:
    """Calls a method. Methods that only notify the agent are optional."""
    bound: Callable[..., object] | None = getattr(agent, method, None)
    if bound is None and method not in DECIDING:
        return None
    if method == "get_action":
        # Agents expect an array, unless they have not loaded numpy.
        numpy = sys.modules.get("numpy")
        if numpy is not None:
            arguments = [numpy.asarray(arguments[0], dtype="float32")]
    assert bound is not None, "`make` checks it"
    value = bound(*arguments)
    # The values of other methods are ignored, and need not be JSON.
    return value if method in DECIDING else None


def plain(value: Any) -> object:  # noqa: ANN401
    """Converts arrays, tensors and their numbers to lists and numbers."""
    if not hasattr(value, "tolist") and hasattr(value, "numpy"):
        value = value.numpy()
    if not hasattr(value, "tolist"):
        raise TypeError(f"the agent returned {type(value).__name__}, not a number or a list of numbers")
    listed: object = value.tolist()
    return listed


if __name__ == "__main__":
    sys.exit(main())
