"""Players for the second version of the reference implementation, good and bad ones. Contains no tests.

They run in separate processes and import only what such players would. Tests create them by name and read their output from files.
"""

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np

Info = dict[str, Any]


class Player:
    """The base class, without optional callbacks."""

    def __init__(self, name: str, **_: object) -> None:
        self.name = f"PLAYER_{name}"

    def get_name(self) -> str:
        return self.name

    def get_action(self, observations: Any) -> Any:
        raise NotImplementedError

    def get_exhanged_cards(self, cards: list[int], amount: int) -> list[int]:
        return sorted(cards)[-amount:]

    def do_special_action(self, info: Info, special_action: str) -> bool:
        return True


class Largest(Player):
    """Takes the last legal action other than passing. Answers with an array-like object."""

    def get_action(self, observations: Any) -> Any:
        legal = np.flatnonzero(observations[28:] == 1)
        answer = np.zeros(200)
        answer[legal[-2] if len(legal) > 1 else legal[0]] = 1
        return answer


class Rarest(Player):
    """Prefers low actions, with 200 scores none of which is 0 or 1, and gives its most common cards."""

    def get_action(self, observations: Any) -> list[float]:
        return [0.5 - index / 1000 - (0.0 if legal else 10.0) for index, legal in enumerate(observations[28:])]

    def get_exhanged_cards(self, cards: list[int], amount: int) -> Any:
        return np.array(cards)[-amount:]

    def do_special_action(self, info: Info, special_action: str) -> Any:
        return np.bool_(False)


class Scribe(Largest):
    """Like `Largest`, and writes every call with its arguments to a file, as a JSON array."""

    def __init__(self, name: str, log_file: str) -> None:
        super().__init__(name)
        self.log_file = log_file

    def write(self, method: str, *arguments: object) -> None:
        with open(self.log_file, "a", encoding="utf-8") as file:
            file.write(json.dumps([method, *arguments], default=lambda array: array.tolist()) + "\n")

    def get_action(self, observations: Any) -> Any:
        answer = super().get_action(observations)
        self.write("get_action", observations, int(np.argmax(answer)))
        return answer

    def get_exhanged_cards(self, cards: list[int], amount: int) -> list[int]:
        answer = super().get_exhanged_cards(cards, amount)
        self.write("get_exhanged_cards", cards, amount, answer)
        return answer

    def do_special_action(self, info: Info, special_action: str) -> bool:
        self.write("do_special_action", info, special_action)
        return True

    def update_start_match(self, cards: list[int], players: list[str], starting_player: str) -> None:
        self.write("update_start_match", cards, players, starting_player)

    def update_exchange_cards(self, cards_sent: list[int], cards_received: list[int]) -> None:
        self.write("update_exchange_cards", cards_sent, cards_received)

    def observe_special_action(self, action_type: str, player: int) -> None:
        self.write("observe_special_action", action_type, player)

    def update_my_action(self, info: Info) -> object:
        self.write("update_my_action", info)
        return object()  # Not representable in JSON.

    def update_action_others(self, info: Info) -> None:
        self.write("update_action_others", info)

    def update_end_match(self, info: Info) -> None:
        self.write("update_end_match", info)

    def update_game_over(self) -> None:
        self.write("update_game_over")


class Present(Largest):
    """Writes its process id to a file in its constructor."""

    def __init__(self, name: str, file: str) -> None:
        super().__init__(name)
        Path(file).write_text(str(os.getpid()), encoding="utf-8")


class Slow(Present):
    """Never returns from its constructor."""

    def __init__(self, name: str, file: str) -> None:
        super().__init__(name, file)
        time.sleep(3600)


class Knowing(Largest):
    """Writes the ticket in its environment to a file."""

    def __init__(self, name: str, file: str) -> None:
        super().__init__(name)
        Path(file).write_text(os.environ.get("CHEFSHAT_TICKET", "nothing"), encoding="utf-8")


class Babbling(Largest):
    """Prints text that looks like answers, with `print` and to the file descriptor, and reads its empty input."""

    def get_action(self, observations: Any) -> Any:
        print('{"id": 1, "value": null}')
        os.write(1, b'{"id": 2, "value": [0]}\n')
        try:
            input()
        except EOFError:
            return super().get_action(observations)
        raise AssertionError("there was something to read")


class Stubborn(Player):
    """Prefers an action that is never legal (face 1 with two jokers), then passing."""

    def get_action(self, observations: Any) -> list[float]:
        return [0.0, 0.0, 2.0] + [0.0] * 196 + [1.0]

    def get_exhanged_cards(self, cards: list[int], amount: int) -> list[int]:
        lacking = next(card for card in range(1, 13) if card not in cards)
        return [lacking] * amount


class Raising(Largest):
    """Raises in every call."""

    def get_action(self, observations: Any) -> Any:
        raise RuntimeError("no idea")

    def get_exhanged_cards(self, cards: list[int], amount: int) -> list[int]:
        raise SystemExit(1)

    def update_action_others(self, info: Info) -> None:
        raise KeyError("what is not there")


class Mortal(Largest):
    """Prints a line and exits at its fifth action."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.actions = 0

    def get_action(self, observations: Any) -> Any:
        self.actions += 1
        if self.actions == 5:
            os.write(2, b"farewell\n")
            os._exit(7)
        return super().get_action(observations)


class Parent(Largest):
    """Starts a program that would never end, writes its process id to a file, and exits."""

    def __init__(self, name: str, file: str) -> None:
        super().__init__(name)
        self.file = file

    def get_action(self, observations: Any) -> Any:
        program = subprocess.Popen(["sleep", "3600"])
        Path(self.file).write_text(str(program.pid), encoding="utf-8")
        os._exit(7)


class Hanging(Largest):
    """Hangs in an action."""

    def get_action(self, observations: Any) -> Any:
        time.sleep(3600)


class Stalling(Largest):
    """Creates a file at its fifth action, and hangs there as long as its command lives."""

    def __init__(self, name: str, file: str) -> None:
        super().__init__(name)
        self.file = file
        self.actions = 0

    def get_action(self, observations: Any) -> Any:
        self.actions += 1
        if self.actions == 5:
            command = os.getppid()
            Path(self.file).write_text(str(os.getpid()), encoding="utf-8")
            while os.getppid() == command:
                time.sleep(0.01)
            os._exit(0)
        return super().get_action(observations)


class Unspeakable(Largest):
    """Answers with an object that is not a number."""

    def get_action(self, observations: Any) -> Any:
        return object()


class Unmade(Largest):
    """Raises in its constructor."""

    def __init__(self, name: str) -> None:
        raise FileNotFoundError("no model there")


class Nothing:
    """Not a player."""

    def get_action(self, observations: Any) -> None:
        return None
