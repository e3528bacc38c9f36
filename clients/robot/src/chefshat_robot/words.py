"""What robots say: all texts, in English and Italian. When they say it is in `body`."""

from __future__ import annotations

from collections.abc import Mapping

TEXTS: Mapping[str, Mapping[str, str]] = {
    "en": {
        "one": "one",
        "joker": "a joker",
        "jokers": "two jokers",
        "and": "{first} and {second}",
        "plural": "{count} {face}s",
        "singular": "{count} {face}",
        "my_singular": "my {face}",
        "my_plural": "my {count} {face}s",
        "my_joker": "my joker",
        "my_jokers": "my jokers",
        "hello": "Hello, I am {name}. Let's make pizza!",
        "play": "I play {cards}.",
        "last_cards": "I play {cards}, and that was my last card!",
        "pass": "I pass.",
        "please_lay": "Please lay {cards} for me.",
        "please_pass": "Please put my pass card down for me.",
        "please_return_pass": "Please take my pass card back for me.",
        "please_give": "Please give {name} {count} of mine: the attendant's screen says which.",
        "please_take_back": "I was too late, so that does not count. Please put {cards} back into my stand.",
        "give": "I give {count} to {name}.",
        "card": "a card",
        "cards": "{count} cards",
        "lead": "That pizza is mine. I start the next one.",
        "food_fight": "Food fight!",
        "dinner": "Dinner is served!",
        "finish_first": "I am the Chef!",
        "finish_middle": "Done. That makes place {place} for me.",
        "finish_last": "I wash the dishes this time.",
        "win": "I won the game! Thank you for playing.",
        "lose": "{name} has won. Well played!",
        "aborted": "The game has ended early. Goodbye.",
    },
    "it": {
        "one": "un",
        "joker": "un jolly",
        "jokers": "due jolly",
        "and": "{first} e {second}",
        "plural": "{count} {face}",
        "singular": "{count} {face}",
        "my_singular": "il mio {face}",
        "my_plural": "i miei {count} {face}",
        "my_joker": "il mio jolly",
        "my_jokers": "i miei jolly",
        "hello": "Ciao, sono {name}. Facciamo la pizza!",
        "play": "Gioco {cards}.",
        "last_cards": "Gioco {cards}, e non ho più carte!",
        "pass": "Passo.",
        "please_lay": "Per favore, giocate {cards} al posto mio.",
        "please_pass": "Per favore, mettete giù la mia carta «passo».",
        "please_return_pass": "Per favore, ridatemi la mia carta «passo».",
        "please_give": "Per favore, date a {name} {count} delle mie: lo schermo dice quali.",
        "please_take_back": "Ero in ritardo e non vale. Per favore, rimettete nel mio reggicarte {cards}.",
        "give": "Do {count} a {name}.",
        "card": "una carta",
        "cards": "{count} carte",
        "lead": "Questa pizza è mia. Comincio io la prossima.",
        "food_fight": "Food Fight!",
        "dinner": "Dinner is Served!",
        "finish_first": "Sono lo Chef!",
        "finish_middle": "Finito. Sono al posto numero {place}.",
        "finish_last": "Questa volta lavo i piatti.",
        "win": "Ho vinto la partita! Grazie di aver giocato.",
        "lose": "Ha vinto {name}. Bella partita!",
        "aborted": "La partita è finita prima del tempo. Arrivederci.",
    },
}
NUMBERS: Mapping[str, tuple[str, ...]] = {
    "en": ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve", "thirteen"),
    "it": (
        "zero",
        "uno",
        "due",
        "tre",
        "quattro",
        "cinque",
        "sei",
        "sette",
        "otto",
        "nove",
        "dieci",
        "undici",
        "dodici",
        "tredici",
    ),
}
LANGUAGES = tuple(TEXTS)


class Words:
    """The texts of one language.

    Attributes:
        language: "en" or "it".
    """

    def __init__(self, language: str = "en") -> None:
        if language not in TEXTS:
            raise ValueError(f"no texts in the language {language!r}: give one of {', '.join(LANGUAGES)}")
        self.language = language
        self._texts = TEXTS[language]

    def say(self, key: str, **values: object) -> str:
        """Returns the text of a key with its values."""
        return self._texts[key].format(**values)

    def cards(self, face: int, quantity: int, jokers: int) -> str:
        """Names the cards of a play, for instance "two 9s and a joker"."""
        parts = []
        if quantity == 1:
            parts.append(self.say("singular", count=self._texts["one"], face=face))
        elif quantity > 1:
            parts.append(self.say("plural", count=self.number(quantity), face=face))
        if jokers:
            parts.append(self._texts["joker" if jokers == 1 else "jokers"])
        return self._joined(parts)

    def my_cards(self, face: int, quantity: int, jokers: int) -> str:
        """Names the same cards as the speaker's, for instance "my two 9s and my joker"."""
        parts = []
        if quantity == 1:
            parts.append(self.say("my_singular", face=face))
        elif quantity > 1:
            parts.append(self.say("my_plural", count=self.number(quantity), face=face))
        if jokers:
            parts.append(self._texts["my_joker" if jokers == 1 else "my_jokers"])
        return self._joined(parts)

    def some_cards(self, count: int) -> str:
        """Names a number of hidden cards."""
        return self._texts["card"] if count == 1 else self.say("cards", count=self.number(count))

    def number(self, count: int) -> str:
        """Returns a number in words, from 13 on in digits."""
        words = NUMBERS[self.language]
        return words[count] if count < len(words) else str(count)

    def _joined(self, parts: list[str]) -> str:
        return parts[0] if len(parts) == 1 else self.say("and", first=parts[0], second=parts[1])
