"""Drivers: one file for each kind of robot, behind the interface in `driver`.

`create` makes one from a text, as `--driver` takes it:

    simulated
    simulated:frames=/tmp/frames,png=true
    jsonlines:host=192.168.1.7,port=7700
    my_package.my_module.MyDriver:port=1234

The last is a class of your own: a subclass of `Driver`, whose constructor takes the options. A package gives its driver a name by
an entry point of the group `chefshat_robot.drivers`, as this one does.
"""

from __future__ import annotations

import inspect
import os
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, get_type_hints

from chefshat_robot.drivers.driver import (
    Act,
    Affect,
    Button,
    CardMove,
    Done,
    Driver,
    Express,
    Failed,
    Gaze,
    Heard,
    Outcome,
    Pick,
    Point,
    Pose,
    RobotError,
    RobotEvent,
    Say,
)

__all__ = [
    "Act",
    "Affect",
    "Button",
    "CardMove",
    "Done",
    "Driver",
    "Express",
    "Failed",
    "Gaze",
    "Heard",
    "Outcome",
    "Pick",
    "Point",
    "Pose",
    "RobotError",
    "RobotEvent",
    "Say",
    "create",
    "find",
    "names",
    "options_of",
    "summary",
]

#: The entry points by which packages, this one among them, add drivers: a name and a class.
GROUP = "chefshat_robot.drivers"


def names() -> list[str]:
    """Returns the names of all installed drivers, sorted."""
    return sorted(entry_points(group=GROUP).names)


def create(spec: str) -> Driver:
    """Creates a driver from "NAME", "NAME:option=value,option=value", or the same with the dotted path of a class.

    Raises:
        RobotError: there is no such driver or option, a value does not fit, or a package is missing. The message says what to do.
    """
    name, _, rest = spec.partition(":")
    found = find(name)
    return found(**_options(name, found, rest))


def options_of(driver: type[Driver]) -> dict[str, tuple[type, Any]]:
    """Returns the options of a driver's class: name, type and default (`inspect.Parameter.empty` for a required one)."""
    hints = get_type_hints(driver.__init__)
    parameters = list(inspect.signature(driver.__init__).parameters.values())[1:]
    return {parameter.name: (_plain(hints.get(parameter.name, str)), parameter.default) for parameter in parameters}


def summary(name: str) -> str:
    """Returns what a driver is for, in one line."""
    return (find(name).__doc__ or "").partition("\n")[0]


def find(name: str) -> type[Driver]:
    """Imports the class of a driver, by its name or dotted path. Raises RobotError if there is none."""
    plugin = next(iter(entry_points(group=GROUP, name=name)), None)
    if plugin is None:
        module, _, class_name = name.rpartition(".")
        if not module:
            raise RobotError(
                f"no driver {name!r}: give one of {', '.join(names())}, or a class of your own as package.module.Class"
            )
        if os.getcwd() not in sys.path:
            sys.path.insert(0, os.getcwd())
        plugin = EntryPoint(name, f"{module}:{class_name}", GROUP)
    try:
        found = plugin.load()
    except (ImportError, AttributeError) as error:
        raise RobotError(f"driver {name}: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Driver)):
        raise RobotError(f"driver {name}: {plugin.attr} is not a subclass of chefshat_robot.drivers.Driver")
    return found


def _options(name: str, driver: type[Driver], text: str) -> dict[str, Any]:
    known = options_of(driver)
    options: dict[str, Any] = {}
    for part in filter(None, text.split(",")):
        key, separator, value = part.partition("=")
        if not separator or key not in known:
            raise RobotError(f"driver {name} has no option {key!r}: give option=value with one of {', '.join(known) or 'none'}")
        options[key] = _convert(f"option {key} of driver {name}", known[key][0], value)
    missing = [key for key, (_, default) in known.items() if default is inspect.Parameter.empty and key not in options]
    if missing:
        raise RobotError(f"driver {name} needs the option {missing[0]!r}: give {name}:{missing[0]}=VALUE")
    return options


def _plain(hint: object) -> type:
    """Returns the type of an option that may be None."""
    arguments = [argument for argument in getattr(hint, "__args__", ()) if argument is not type(None)]
    plain: object = arguments[0] if arguments else hint
    return plain if isinstance(plain, type) else str


def _convert(what: str, kind: type, text: str) -> object:
    if kind is bool:
        if text.lower() not in ("true", "false", "1", "0"):
            raise RobotError(f"{what}: {text!r} is not true or false")
        return text.lower() in ("true", "1")
    if kind is Path:
        return Path(text)
    try:
        return kind(text)
    except ValueError:
        raise RobotError(f"{what}: {text!r} is not a number") from None
