"""A robot as the voice of a physical table: it asks the table's open questions aloud, and reports answers that it hears.

Who asks, and what the answers change, is the business of perception and the referee.
"""

from __future__ import annotations

import logging
import re

from chefshat import ChefsHatError, aio, pb

from chefshat_robot.body import Body
from chefshat_robot.drivers.driver import Heard
from chefshat_robot.words import NUMBERS

LOG = logging.getLogger("chefshat_robot")
# The least confidence of speech recognition for an answer.
MIN_CONFIDENCE = 0.5
# The language of the server's and the bridges' texts.
LANGUAGE = "en"


class Questions:
    """Asks the questions of a table, each once, and answers those whose answer was heard."""

    def __init__(self, client: aio.Client, table_ticket: str, body: Body) -> None:
        """Sets the table and the voice.

        Args:
            client: the connection to the server.
            table_ticket: of the table, from creating the room.
            body: says the questions.
        """
        self._client = client
        self._ticket = table_ticket
        self._body = body
        self._open: list[pb.TableQuestion] = []
        self._asked: set[str] = set()

    async def follow(self) -> None:
        """Asks what is to be asked, until the game is over."""
        try:
            async for state in self._client.tables.watch(self._ticket):
                self._open = list(state.questions)
                for question in self._open:
                    if question.question_id not in self._asked:
                        self._asked.add(question.question_id)
                        self._body.say(question.text, LANGUAGE)
        except ChefsHatError as error:
            LOG.warning("the table's questions are not asked: %s", error)

    async def heard(self, heard: Heard) -> None:
        """Answers the oldest open question, if what was heard says exactly one of its options."""
        if not self._open or heard.confidence < MIN_CONFIDENCE:
            return
        question = self._open[0]
        option = option_said(heard.text, list(question.options))
        if option is None:
            return
        answer = pb.QuestionAnswered(question_id=question.question_id, option=option)
        report = pb.TableReport(source=pb.REPORT_SOURCE_ROBOT, answer=answer)
        try:
            await self._client.tables.report(self._ticket, report)
            LOG.info("heard the answer %r to %r", question.options[option], question.text)
        except ChefsHatError as error:
            LOG.warning("an answer was not reported: %s", error)


def option_said(text: str, options: list[str]) -> int | None:
    """Returns the index of the only option whose words occur in a text; None if there is none, or more than one.

    Numbers may be said as words, in any language of `words`.
    """
    said = _words(text)
    found = [index for index, option in enumerate(options) if (words := _words(option)) and _contains(said, words)]
    return found[0] if len(found) == 1 else None


def _words(text: str) -> list[str]:
    """Splits a text into words in lower case, with numbers as digits."""
    digits = {word: str(number) for numbers in NUMBERS.values() for number, word in enumerate(numbers)}
    return [digits.get(word, word) for word in re.findall(r"\w+", text.lower())]


def _contains(said: list[str], wanted: list[str]) -> bool:
    return any(said[start : start + len(wanted)] == wanted for start in range(len(said) - len(wanted) + 1))
