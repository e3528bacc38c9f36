"""Bottles, YARP's lists, as text: words, numbers, quoted strings, vocabs in square brackets, and nested lists in parentheses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TypeAlias

Item: TypeAlias = "str | float | int | list[Item]"
_TOKENS = re.compile(
    r'\s*(?:(?P<open>\()|(?P<close>\))|"(?P<quoted>(?:[^"\\]|\\.)*)"'
    r'|\[(?P<vocab>[^\]]*)\]|(?P<word>[^\s()"\[\]]+))'
)
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\0": "\\0"}
_PLAIN = {escaped: plain for plain, escaped in _ESCAPES.items()}


class BottleError(ValueError):
    """A text that is not a bottle."""


class Word(str):
    """A word that is written without quotes."""

    __slots__ = ()


def write(items: Sequence[Item]) -> str:
    """Returns a bottle as text, on one line. Strings are quoted, unless they are `Word`s."""
    return " ".join(map(_item, items))


def parse(text: str) -> list[Item]:
    """Returns the items of a bottle. Vocabs and words are strings.

    Raises:
        BottleError: quotes or parentheses do not match.
    """
    stack: list[list[Item]] = [[]]
    at = 0
    text = text.strip()
    while at < len(text):
        found = _TOKENS.match(text, at)
        if found is None:
            raise BottleError(f"not a bottle, at character {at}: {text!r}")
        at = found.end()
        if found["open"]:
            stack.append([])
        elif found["close"]:
            if len(stack) == 1:
                raise BottleError(f"a closing parenthesis too many: {text!r}")
            inner = stack.pop()
            stack[-1].append(inner)
        elif found["quoted"] is not None:
            stack[-1].append(re.sub(r"\\.", lambda pair: _PLAIN.get(pair[0], pair[0][1:]), found["quoted"]))
        else:
            word = found["vocab"] if found["vocab"] is not None else found["word"]
            stack[-1].append(word if found["vocab"] is not None else _number(word))
    if len(stack) > 1:
        raise BottleError(f"a parenthesis is not closed: {text!r}")
    return stack[0]


def _item(item: Item) -> str:
    if isinstance(item, list):
        return f"({write(item)})"
    if isinstance(item, Word):
        return str(item)
    if isinstance(item, str):
        return '"' + "".join(_ESCAPES.get(character, character) for character in item) + '"'
    return repr(item)


def _number(word: str) -> Item:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
