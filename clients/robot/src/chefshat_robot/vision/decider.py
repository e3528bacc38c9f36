"""Decides over several frames what happened at the table: sightings in, events out.

The decider sees no pictures, so that a recording of sightings gives the same events as the camera did. Its rule:

- A card **settles** when its tag was read in `SETTLE_READS` frames within `STILL_MM` while nothing moved around its place.
- Cards that settled are reported together as soon as the hands have left the field, nothing moves at any place for cards
  (`QUIET_FRAMES`) and every place is **explained**: its look is the one it had before, it is empty, or the card on top of it was
  read since then. What happens next closes a play, too.
- A place that stays unexplained for `DOUBT_SECONDS` while no arm reaches over the edge of the field becomes a doubt, and so does
  one that is covered again before it could be read.
  Later events wait until the doubt is answered or resolved: an event is never reported on top of one that may be missing.
- A card or pass card is gone when its place looks empty for `GONE_FRAMES`. While an arm reaches over the field, it may only hide
  them: what is gone is decided when it has left, or when new cards lie there. The field is cleared when all its cards are gone, or
  if only some are, when none of the others can be read as new cards come. If others can still be read after `TAKEN_SECONDS` in
  which nothing moved, cards were taken back: before that, more strokes may sweep the rest away. Cards on others were taken back
  when a tag is read that they covered.
- What lies at a place from the first frame, until something moves there, was **found**: it may have lain there for long. A hand
  that is laying cards as perception begins has laid some of them before: until the field is at rest for the first time, what is new
  at an empty place belongs to what was found.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from dataclasses import field as dataclass_field

from chefshat_robot import field
from chefshat_robot.deck import Card, Piece, PieceKind, deck, piece_of_tag

from .events import Cleared, Doubt, DoubtResolved, FieldChanged, Laid, Observed, PassShown, PassWithdrawn, TakenBack
from .reader import SPOTS, STILL_FRAMES, SeenPlace, SeenTag, Sighting

SETTLE_READS = 3
"""A card is believed after so many readings at one position."""
STILL_MM = 1.5
"""Readings within this distance are of one position, in mm. The hand that still holds a card moves it further."""
QUIET_FRAMES = 3
"""Cards are reported when nothing has moved at any place for so many frames."""
GONE_FRAMES = 3
"""A place is empty when it has looked empty for so many frames."""
DOUBT_SECONDS = 1.2
"""A place that cannot be explained for this long becomes a doubt, in s."""
LONGEST_FRAME = 0.25
"""A frame after a longer time counts as so long, in s: while the camera was away, nobody waited for anything."""
TAKEN_SECONDS = 1.2
"""Cards that are gone while others stay were taken back when nothing has moved for this long, in s."""
TOGETHER_SECONDS = 0.8
"""What begins no more than this before the first card of a play, or before clearing, is of the same movement of a hand, in s."""
REACH = 45.0
"""A card belongs to the nearest place, if its centre is no further from it than this, in mm."""
REMEMBERED = 120
"""Frames of which it is remembered over which sides of the field something reached."""
LAID_FRAMES = 6
"""A card was laid in so many frames before its place became still: whose arm reached in then laid it."""
TRUSTED_HAMMING = 1
"""Readings of tags with more corrected bits count half."""
SAME_CARD_MM = 12.0
"""The two tags of a card give its centre within this distance; else there are two cards with one code, in mm."""

CARD_SPOTS = range(len(field.places()))
"""The places for cards among all places."""
_FIRST_PASS = len(CARD_SPOTS)
_TAG_TO_CENTRE = (field.CARD_WIDTH / 2 - field.CARD_TAG_CENTRE[0], field.CARD_HEIGHT / 2 - field.CARD_TAG_CENTRE[1])


@dataclass
class _Track:
    """A piece while its place is still."""

    piece: Piece
    spot: int
    x: float
    y: float
    angle: float
    readings: float = 0.0
    """Frames in which it was read."""
    ends: set[bool] = dataclass_field(default_factory=set)
    """Which of its two tags were read."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """Its centre, mm on the field, and its angle in degrees."""
        return (*_centre_of(self.x, self.y, self.angle), self.angle)

    def tag(self, flipped: bool) -> tuple[float, float]:
        """Where one of its tags lies, mm on the field."""
        x, y, _ = self.pose
        return (2 * x - self.x, 2 * y - self.y) if flipped else (self.x, self.y)


@dataclass
class _Known:
    """A piece that lies on the field, as far as is known."""

    spot: int
    told: bool = False
    """Whether it is the answer to a doubt, and was never read."""
    pose: tuple[float, float, float] | None = None
    """Its centre, mm on the field, and its angle in degrees; None if it was never read."""

    def covers(self, x: float, y: float) -> bool:
        """Whether a tag at a point lies beneath it, at least with its middle."""
        centre_x, centre_y, angle = self.pose or (SPOTS[self.spot].x, SPOTS[self.spot].y, 0.0)
        turn = math.radians(angle)
        right = (x - centre_x) * math.cos(turn) + (y - centre_y) * math.sin(turn)
        down = (y - centre_y) * math.cos(turn) - (x - centre_x) * math.sin(turn)
        return abs(right) < field.CARD_WIDTH / 2 and abs(down) < field.CARD_HEIGHT / 2


@dataclass(frozen=True)
class _Riddle:
    """A look of a place that is not explained.

    Attributes:
        look: The look.
        since: When it was first seen, in s.
        seen: When it was last seen, in s.
        options: The cards it may show, the likeliest first.
        found: Whether what it shows was found; None if it may be of the play that is open.
    """

    look: int
    since: float
    seen: float
    options: tuple[Card, ...]
    found: bool | None


@dataclass
class _Spot:
    """What is known of a place."""

    explained: int = 0
    """The last look that was explained."""
    unexplained: bool = False
    """Whether it is still and unexplained."""
    waited: float = 0.0
    """For how long it has been unexplained while no arm reached over the field, in s."""
    frames: int = 0
    """For how many such frames."""
    since: float = 0.0
    """When it was first seen so, in s."""
    seen: float = 0.0
    """When it was last seen so, in s."""
    covered: _Riddle | None = None
    """A look that was covered before it could be explained."""
    doubt: int | None = None
    """The open doubt about its present look."""
    gone_since: float | None = None
    """Since when it looks empty although cards lay there, in s."""
    watched: bool = False
    """Whether it was empty when the field was at rest or cleared, or something moved over what lay there: what is new there was not
    found. A place for a pass card need only have been empty."""
    vacant: bool = False
    """Whether it was seen empty."""

    @property
    def found(self) -> bool | None:
        """Whether what is new there was found; None if it may be of the open play: it was vacant, and is not watched yet."""
        return None if self.vacant and not self.watched else not self.watched


@dataclass
class _Play:
    """Cards that were laid together.

    Attributes:
        since: When the first of them was noticed, in s.
    """

    since: float
    cards: dict[Card, int] = dataclass_field(default_factory=dict)
    """The cards and their spots."""
    doubts: set[int] = dataclass_field(default_factory=set)
    """Its open doubts."""
    closed: bool = False
    """Whether no further card can belong to it."""
    sides: set[int | None] = dataclass_field(default_factory=set)
    """The sides from which its cards were laid; None for one that is not known."""
    found: bool = False
    """Whether its cards were found."""

    @property
    def side(self) -> int | None:
        """The side from which all its cards were laid; None if that is not sure."""
        return next(iter(self.sides)) if len(self.sides) == 1 else None


@dataclass
class _Gone:
    """Cards were taken away: some (`TakenBack`), or all (`Cleared`)."""

    since: float
    cards: dict[Card, int] | None = None


@dataclass
class _PassMoved:
    """The pass card of a seat was shown, or found, or withdrawn."""

    since: float
    seat: int
    shown: bool
    found: bool = False


@dataclass
class _OpenDoubt:
    """A doubt that waits for an answer."""

    spot: int
    look: int
    play: _Play
    """Where the card belongs. For a pass card: a play without cards that keeps the order."""


class Decider:
    """Turns sightings into events.

    Args:
        deck: The deck that is played with, 0..6; cards of other decks are ignored. None: any deck.
    """

    def __init__(self, deck: int | None = None) -> None:
        self._deck = deck
        self._known: dict[Piece, _Known] = {}
        self._tracks: dict[Piece, _Track] = {}
        self._spots = [_Spot() for _ in SPOTS]
        self._queue: list[_Play | _Gone | _PassMoved] = []
        self._doubts: dict[int, _OpenDoubt] = {}
        self._next_doubt = 1
        self._frame = 0
        self._time = 0.0
        self._moved = 0.0
        self._reaching = False
        # Whether the field has been at rest, or cleared.
        self._rested = False
        # The sides over which something reached in the latest frames.
        self._reached: deque[tuple[int, ...]] = deque(maxlen=REMEMBERED)
        self._places: tuple[SeenPlace, ...] = ()

    # What a bridge and a reader may ask.

    @property
    def unexplained(self) -> set[int]:
        """The places that should be read again: something new lies there. Indices of `SPOTS`."""
        return {number for number, spot in enumerate(self._spots) if spot.unexplained}

    @property
    def on_table(self) -> dict[Card, int]:
        """The cards that lie on the field and the place of each, 1..11; the lowest first."""
        return {card: known.spot + 1 for piece, known in self._known.items() if (card := piece.card) is not None}

    def answers(self, place: int) -> list[Card]:
        """The cards that may lie on top of a place, one of each face: for a person who answers a doubt and knows only the face.

        Of a face that lies beneath the top there, it is that card; otherwise one that does not lie on the field.

        Args:
            place: 1..11.
        """
        number = self._deck if self._deck is not None else next((card.deck for card in self.on_table), 0)
        beneath = [card for card, at in self.on_table.items() if at == place][:-1]
        left = [card for card in deck(number) if card not in self.on_table]
        of_face = {card.face: card for card in reversed(left)} | {card.face: card for card in beneath}
        return [of_face[face] for face in sorted(of_face)]

    def lies_at(self, spot: int) -> bool:
        """Whether something lies at a place, an index of `SPOTS`, as far as is known."""
        return self._top(spot) is not None

    def shows(self, spot: int, look: int) -> bool:
        """Whether a place, an index of `SPOTS`, has a look now."""
        return bool(self._places) and self._places[spot].look == look

    def look_of_doubt(self, number: int) -> tuple[int, int] | None:
        """The place that an open doubt is about, as an index of `SPOTS`, and its look; None if the doubt is not open."""
        doubt = self._doubts.get(number)
        return None if doubt is None else (doubt.spot, doubt.look)

    # Sightings.

    def see(self, sighting: Sighting) -> list[Observed]:
        """Takes in the next frame and returns what is now certain."""
        passed = min(sighting.time - self._time, LONGEST_FRAME)
        self._frame, self._time = sighting.frame, sighting.time
        events: list[Observed] = []
        if sighting.field is not None:
            events.append(FieldChanged(self._frame, self._time, sighting.field))
            self._tracks.clear()
        self._places = sighting.places
        self._reaching = sighting.reaching
        self._reached.append(sighting.sides)
        if sighting.places:
            if any(sighting.places[spot].still == 0 for spot in CARD_SPOTS):
                self._moved = self._time
            self._forget_moved()
            self._follow_tags(sighting.tags)
            self._settle(events)
            self._explain(passed)
            self._notice_uncovered(events)
            self._notice_gone(events)
            self._raise_doubts(events)
        self._flush(events)
        if not self._rested and self._is_quiet():
            self._watch()
        return events

    def answer(self, number: int, reading: Card | bool | None) -> list[Observed]:
        """Answers a doubt and returns the events that were waiting for it.

        Args:
            number: The number of the doubt.
            reading: The card that lies there. At a pass place: whether the pass card lies there. False at a place for cards:
                nothing new lies there. None: that is not known, and nothing is reported.

        Raises:
            ValueError: There is no such open doubt, or the answer does not fit its place.
        """
        if number not in self._doubts:
            raise ValueError(f"doubt {number} is not open: it was answered or resolved before")
        doubt = self._doubts[number]
        is_pass = doubt.spot >= _FIRST_PASS
        if reading is not None and isinstance(reading, bool) != (is_pass or reading is False):
            raise ValueError("answer with True or False at a pass place, and with a card or False at a place for cards")
        events: list[Observed] = []
        if isinstance(reading, Card):
            self._add_told(doubt, reading)
        elif is_pass and reading is not None:
            self._tell_pass(doubt, reading)
        self._close_doubt(number, events)
        self._flush(events)
        return events

    def _add_told(self, doubt: _OpenDoubt, card: Card) -> None:
        """Adds the card that answers a doubt to its play, unless it was read there in the meantime."""
        for play in self._queue:
            if isinstance(play, _Play) and play is not doubt.play:
                for read, spot in list(play.cards.items()):
                    # A card that was read may have been cleared meanwhile.
                    known = self._known.get(_piece(read))
                    was_read = known is None or not known.told
                    if spot == doubt.spot and (read == card or (read.face == card.face and was_read)):
                        del play.cards[read]
                        doubt.play.cards[read] = spot
                        if not play.cards and not play.doubts:
                            self._queue.remove(play)
                        return
        pile = self._pile(doubt.spot)
        if _piece(card) in pile[:-1]:
            # The cards on top of it were taken back.
            above = pile[pile.index(_piece(card)) + 1 :]
            self._queue.insert(self._queue.index(doubt.play), _Gone(doubt.play.since, self._forget(above)))
            return
        doubt.play.cards[card] = doubt.spot
        later = self._queue[self._queue.index(doubt.play) + 1 :]
        if not any(isinstance(entry, _Gone) and entry.cards is None for entry in later):
            # Cards that were laid on top in the meantime stay on top.
            self._known = {_piece(card): _Known(doubt.spot, told=True), **self._known}

    def _tell_pass(self, doubt: _OpenDoubt, shown: bool) -> None:
        """Puts the answer to a doubt about a pass card in its place in the queue."""
        seat = doubt.spot - _FIRST_PASS
        piece = next((piece for piece, known in self._known.items() if known.spot == doubt.spot), None)
        if shown == (piece is not None):
            return
        self._queue.insert(self._queue.index(doubt.play), _PassMoved(doubt.play.since, seat, shown, doubt.play.found))
        if piece is not None:
            del self._known[piece]
        else:
            self._known[Piece(PieceKind.PASS, self._deck or 0, seat)] = _Known(doubt.spot, told=True)

    def _close_doubt(self, number: int, events: list[Observed]) -> None:
        doubt = self._doubts.pop(number)
        doubt.play.doubts.discard(number)
        spot = self._spots[doubt.spot]
        if spot.doubt == number:
            spot.doubt = None
            if self.shows(doubt.spot, doubt.look):
                spot.explained = doubt.look
                spot.unexplained, spot.waited, spot.frames = False, 0.0, 0
        events.append(DoubtResolved(self._frame, self._time, number))

    # Following tags.

    def _forget_moved(self) -> None:
        """Forgets the readings at places where something moves."""
        for number, (spot, seen) in enumerate(zip(self._spots, self._places, strict=True)):
            if seen.still == 0:
                if spot.frames >= SETTLE_READS and spot.covered is None and spot.doubt is None:
                    spot.covered = self._riddle(number)
                is_something = spot.covered is not None or spot.doubt is not None or self.lies_at(number)
                spot.watched = spot.watched or is_something
                spot.unexplained, spot.waited, spot.frames = False, 0.0, 0
        self._tracks = {piece: track for piece, track in self._tracks.items() if self._places[track.spot].still > 0}

    def _follow_tags(self, tags: Iterable[SeenTag]) -> None:
        """Counts the readings of each piece."""
        by_piece: dict[Piece, list[SeenTag]] = {}
        for tag in tags:
            piece = piece_of_tag(tag.number)
            if piece is not None and self._deck in (None, piece.deck) and piece.kind is not PieceKind.ROLE:
                by_piece.setdefault(piece, []).append(tag)
        for piece, readings in by_piece.items():
            centres = [_centre(tag) for tag in readings]
            if any(math.dist(centres[0], centre) > SAME_CARD_MM for centre in centres[1:]):
                continue
            spot = _spot_of(piece, *centres[0])
            if spot is None or self._places[spot].still == 0:
                continue
            for tag, (x, y) in zip(readings, centres, strict=True):
                track = self._tracks.get(piece)
                flipped = track is not None and abs((tag.angle - track.angle + 180) % 360 - 180) > 90
                if track is None or (not flipped and math.hypot(track.x - tag.x, track.y - tag.y) > STILL_MM):
                    track = self._tracks[piece] = _Track(piece, spot, tag.x, tag.y, tag.angle)
                if flipped and math.dist((x, y), _centre_of(track.x, track.y, track.angle)) > SAME_CARD_MM:
                    continue
                track.ends.add(flipped)
            track = self._tracks.get(piece)
            if track is not None:
                track.readings += 1.0 if min(tag.hamming for tag in readings) <= TRUSTED_HAMMING else 0.5

    def _settle(self, events: list[Observed]) -> None:
        """Takes note of the pieces that settled."""
        # Of a pile, the card that is seen whole lies on top.
        for track in sorted(self._tracks.values(), key=lambda track: len(track.ends)):
            if track.readings < SETTLE_READS or track.piece not in self._tracks:
                continue
            known = self._known.get(track.piece)
            if known is not None:
                known.spot, known.told, known.pose = track.spot, False, track.pose
                self._spots[track.spot].gone_since = None
                top = self._top(track.spot)
                if top == track.piece and len(track.ends) == 2:
                    self._explained(track.spot, events)
            elif track.piece.card is None:
                self._known[track.piece] = _Known(track.spot, pose=track.pose)
                self._queue.append(_PassMoved(self._time, track.piece.number, True, not self._spots[track.spot].watched))
                self._explained(track.spot, events)
            else:
                self._settle_card(track, track.piece.card, events)

    def _settle_card(self, track: _Track, card: Card, events: list[Observed]) -> None:
        """Takes note of a card that was not on the field before."""
        self._settle_gone(events)
        spot = self._spots[track.spot]
        top = self._top(track.spot)
        if top is not None and self._known[top].told and top.card is not None and top.card.face == card.face:
            # The person who answered a doubt knew the face; this is the card.
            told = top.card
            del self._known[top]
            self._known[track.piece] = _Known(track.spot, pose=track.pose)
            for entry in self._queue:
                if isinstance(entry, _Play) and told in entry.cards:
                    entry.cards[card] = entry.cards.pop(told)
            self._explained(track.spot, events)
            return
        self._known[track.piece] = _Known(track.spot, pose=track.pose)
        if spot.doubt is not None and self._doubts[spot.doubt].look == self._places[track.spot].look:
            self._doubts[spot.doubt].play.cards[card] = track.spot
            self._explained(track.spot, events)
            return
        play, found = self._open_play(), spot.found is not False
        if spot.covered is not None and play is not None and spot.covered.since < play.since - TOGETHER_SECONDS:
            self._raise_doubt(track.spot, spot.covered, events, play)
        elif play is not None and play.found and spot.found:
            # Of what was found, the play is what lies on top.
            play.cards = {other: at for other, at in play.cards.items() if at != track.spot}
        elif spot.covered is not None or (
            play is not None and (not self._may_join(play, spot.found, card) or track.spot in play.cards.values())
        ):
            self._close_play(events)
            # What is laid at a vacant place after another play was not found.
            play, found = None, bool(spot.found)
        if play is None:
            play = _Play(self._time, found=found)
            self._queue.append(play)
        play.cards[card] = track.spot
        play.sides.add(self._side_of(track.spot))
        self._explained(track.spot, events)

    def _may_join(self, play: _Play, found: bool | None, card: Card | None) -> bool:
        """Whether what is new may be of an open play, by whether it was found; the card is None if it cannot be read."""
        if found is not None:
            return found == play.found
        if not play.found:
            return True
        # A hand that was laying cards as perception began lays more of that face; or it lays the next play beside them.
        if card is None:
            return not any(self._spots[at].watched for at in play.cards.values())
        faces = {other.face for other in play.cards if not other.is_joker}
        return card.is_joker or not faces or card.face in faces

    def _watch(self) -> None:
        """The field is at rest, or cleared: what is new at a vacant place from now on was not found."""
        self._rested = True
        for spot in self._spots:
            spot.watched = spot.watched or spot.vacant

    def _side_of(self, spot: int) -> int | None:
        """The side from which the card on top of a place was laid; None if nothing reached in then, or over several sides."""
        became_still = len(self._reached) - self._places[spot].still
        laid = list(self._reached)[max(became_still - LAID_FRAMES, 0) : max(became_still, 0)]
        sides = {side for reached in laid for side in reached}
        return sides.pop() if len(sides) == 1 else None

    def _open_play(self) -> _Play | None:
        """The play that further cards may belong to."""
        last = next((entry for entry in reversed(self._queue) if not isinstance(entry, _PassMoved)), None)
        return last if isinstance(last, _Play) and not last.closed else None

    def _close_play(self, events: list[Observed]) -> None:
        """Ends the play that is open, as the next one begins: asks about its cards that were covered before they were read."""
        play = self._open_play()
        for number in CARD_SPOTS:
            spot = self._spots[number]
            if spot.covered is not None:
                self._raise_doubt(number, spot.covered, events, play)
        if play is not None:
            play.closed = True

    def _pile(self, spot: int) -> list[Piece]:
        """The pieces at a place, the lowest first."""
        return [piece for piece, known in self._known.items() if known.spot == spot]

    def _top(self, spot: int) -> Piece | None:
        """The piece on top of a place."""
        return next(reversed(self._pile(spot)), None)

    # Explaining looks.

    def _explained(self, number: int, events: list[Observed]) -> None:
        """A place's present look is explained, and with it a doubt about this look."""
        spot = self._spots[number]
        spot.explained = self._places[number].look
        spot.unexplained, spot.waited, spot.frames, spot.covered = False, 0.0, 0, None
        if spot.doubt is not None and self._doubts[spot.doubt].look == spot.explained:
            self._close_doubt(spot.doubt, events)

    def _explain(self, passed: float) -> None:
        """Finds the places that are still and not explained; `passed` is the time since the last frame, in s."""
        for number, (spot, seen) in enumerate(zip(self._spots, self._places, strict=True)):
            if seen.still < STILL_FRAMES or self._is_unclear(number):
                continue
            if seen.empty:
                spot.vacant = True
                spot.watched = spot.watched or self._rested or number >= _FIRST_PASS
            occupied = self.lies_at(number)
            if not occupied and seen.empty:
                spot.explained = seen.look
            was_unexplained, spot.unexplained = spot.unexplained, seen.look != spot.explained and not seen.empty
            if occupied and seen.look == spot.explained:
                spot.covered = None
            if not was_unexplained:
                spot.since = self._time
            if spot.covered is not None and spot.covered.look == seen.look:
                spot.since, spot.covered = spot.covered.since, None
            if not spot.unexplained:
                spot.waited, spot.frames = 0.0, 0
            elif not self._reaching:
                spot.waited += passed
                spot.frames += 1
                spot.seen = self._time

    def _raise_doubts(self, events: list[Observed]) -> None:
        """Asks about places that stay unexplained."""
        for number, spot in enumerate(self._spots):
            open_play = self._open_play() if number in CARD_SPOTS else None
            if spot.covered is not None and not self.lies_at(number) and self._is_empty(number):
                self._raise_doubt(number, spot.covered, events, open_play)
            elif spot.doubt is None and spot.waited >= DOUBT_SECONDS:
                if spot.covered is not None:
                    self._raise_doubt(number, spot.covered, events, open_play)
                    open_play = None
                self._raise_doubt(number, self._riddle(number), events, open_play)

    def _riddle(self, number: int) -> _Riddle:
        """The present look of a place, as a riddle."""
        tracks = sorted((track for track in self._tracks.values() if track.spot == number), key=lambda track: -track.readings)
        options = tuple(card for track in tracks if track.piece not in self._known and (card := track.piece.card) is not None)
        spot = self._spots[number]
        return _Riddle(self._places[number].look, spot.since, spot.seen, options, spot.found)

    def _raise_doubt(self, number: int, riddle: _Riddle, events: list[Observed], play: _Play | None) -> None:
        """Asks about a look of a place, whose card belongs to a play; or to one of its own, in the order of the times."""
        spot = self._spots[number]
        spot.covered = None
        if (
            play is None
            or not self._may_join(play, riddle.found, None)
            or riddle.since < play.since - TOGETHER_SECONDS
            or number in play.cards.values()
        ):
            play = _Play(riddle.since, found=riddle.found is not False)
            self._queue.insert(sum(entry.since <= riddle.since for entry in self._queue), play)
        play.doubts.add(self._next_doubt)
        play.closed = True
        if riddle.look == self._places[number].look:
            spot.doubt = self._next_doubt
        self._doubts[self._next_doubt] = _OpenDoubt(number, riddle.look, play)
        events.append(Doubt(self._frame, self._time, self._next_doubt, SPOTS[number].name, riddle.seen, riddle.options))
        self._next_doubt += 1

    # Cards that are gone.

    def _notice_uncovered(self, events: list[Observed]) -> None:
        """Notices cards that were taken from others: a tag is read that they covered."""
        for number in CARD_SPOTS:
            pile = self._pile(number)
            read = [place for place, piece in enumerate(pile) if piece in self._tracks]
            if not read or self._spots[number].frames < SETTLE_READS:
                continue
            track = self._tracks[pile[read[-1]]]
            above = pile[read[-1] + 1 :]
            if above and track.readings >= SETTLE_READS and all(self._is_uncovered(track, piece) for piece in above):
                self._explained(number, events)
                self._queue.append(_Gone(self._time, self._forget(above)))

    def _is_uncovered(self, track: _Track, above: Piece) -> bool:
        """Whether a tag of a card is read that a card on top of it covered."""
        return any(self._known[above].covers(*track.tag(flipped)) for flipped in track.ends)

    def _notice_gone(self, events: list[Observed]) -> None:
        """Notices pieces that are no longer where they lay."""
        for piece, known in list(self._known.items()):
            if piece.kind is PieceKind.PASS and not self._reaching and self._is_empty(known.spot):
                del self._known[piece]
                self._queue.append(_PassMoved(self._time, piece.number, False))
                self._explained(known.spot, events)
        occupied = {known.spot for piece, known in self._known.items() if piece.kind is PieceKind.CARD}
        for spot in occupied:
            if self._spots[spot].gone_since is None and self._is_empty(spot):
                self._spots[spot].gone_since = self._time
        gone = self._gone()
        if self._reaching:
            return
        if gone and len(gone) == len(occupied):
            self._clear(events)
        elif gone and self._time - self._moved >= TAKEN_SECONDS and self._some_stayed(gone):
            self._queue.append(_Gone(self._time, self._remove(gone, events)))

    def _gone(self) -> list[int]:
        """The places whose cards are gone."""
        return [number for number in CARD_SPOTS if self._spots[number].gone_since is not None]

    def _some_stayed(self, gone: Iterable[int]) -> bool:
        """Whether cards at other places can still be read, so that light or shadow does not only hide that these are empty too."""
        rest = set(CARD_SPOTS) - set(gone)
        return any(known.spot in rest and (piece in self._tracks or known.told) for piece, known in self._known.items())

    def _settle_gone(self, events: list[Observed]) -> None:
        """As new cards lie there, decides whether all cards are gone, or those that stayed can still be read."""
        gone = self._gone()
        if not gone:
            return
        if self._some_stayed(gone):
            self._queue.append(_Gone(self._time, self._remove(gone, events)))
        else:
            self._clear(events)

    def _clear(self, events: list[Observed]) -> None:
        """Takes note that all cards are gone. Looks that began with the clearing are not of cards: light moved, or a hand."""
        began = min(since for spot in self._spots if (since := spot.gone_since) is not None) - TOGETHER_SECONDS
        for spot in self._spots[:_FIRST_PASS]:
            if spot.covered is not None and spot.covered.since > began:
                spot.covered = None
        self._close_play(events)
        self._remove([known.spot for piece, known in self._known.items() if piece.kind is PieceKind.CARD], events)
        self._queue.append(_Gone(self._time))
        self._watch()

    def _remove(self, spots: list[int], events: list[Observed]) -> dict[Card, int]:
        """Forgets the cards of some places and returns them."""
        removed = self._forget([piece for piece, known in self._known.items() if known.spot in spots])
        for spot in spots:
            self._spots[spot].gone_since = None
            if self._is_empty(spot):
                self._explained(spot, events)
        return removed

    def _forget(self, pieces: Iterable[Piece]) -> dict[Card, int]:
        """Forgets cards that are gone and returns them."""
        removed: dict[Card, int] = {}
        for piece in pieces:
            known = self._known.pop(piece)
            self._tracks.pop(piece, None)
            if piece.card is not None:
                removed[piece.card] = known.spot
        return removed

    def _is_empty(self, spot: int) -> bool:
        """Whether a place has been empty for long enough."""
        seen = self._places[spot]
        return bool(seen.empty) and seen.still >= GONE_FRAMES

    # Reporting.

    def _flush(self, events: list[Observed]) -> None:
        """Reports what need not wait any more, in order."""
        while self._queue:
            entry = self._queue[0]
            if any(since < entry.since for since in self._waiting()):
                return
            if isinstance(entry, _Play):
                if entry.doubts or not (entry.closed or self._is_quiet()):
                    return
                entry.closed = True
                if entry.cards:
                    events.append(Laid(self._frame, self._time, *_in_order(entry.cards), entry.side, entry.found))
            elif isinstance(entry, _PassMoved) and entry.shown:
                events.append(PassShown(self._frame, self._time, entry.seat, entry.found))
            elif isinstance(entry, _PassMoved):
                events.append(PassWithdrawn(self._frame, self._time, entry.seat))
            elif entry.cards is None:
                events.append(Cleared(self._frame, self._time))
            else:
                events.append(TakenBack(self._frame, self._time, *_in_order(entry.cards)))
            self._queue.pop(0)

    def _waiting(self) -> list[float]:
        """Since when there are looks that are neither explained nor asked about, in s."""
        covered = [spot.covered.since for spot in self._spots if spot.covered is not None]
        return covered + [spot.since for spot in self._spots if spot.unexplained and spot.doubt is None]

    def _is_unclear(self, spot: int) -> bool:
        """Whether too little was seen of a place yet to tell whether something lies there."""
        return self._places[spot].empty is None and not self.lies_at(spot)

    def _is_quiet(self) -> bool:
        """Whether no arm reaches over the field, nothing moves at the places for cards, and all of them are explained."""
        return (
            bool(self._places)
            and not self._reaching
            and all(
                self._places[spot].still >= QUIET_FRAMES
                and not self._is_unclear(spot)
                and (not self._spots[spot].unexplained or self._spots[spot].doubt is not None)
                for spot in CARD_SPOTS
            )
        )


def _in_order(cards: dict[Card, int]) -> tuple[tuple[Card, ...], tuple[int, ...]]:
    """Cards in the order of their places, and the place of each, 1..11."""
    ordered = sorted(cards, key=lambda card: cards[card])
    return tuple(ordered), tuple(cards[card] + 1 for card in ordered)


def _piece(card: Card) -> Piece:
    """A card as a piece."""
    return Piece(PieceKind.CARD, card.deck, card.index)


def _centre(tag: SeenTag) -> tuple[float, float]:
    """The centre of the card that has a tag, mm on the field."""
    return _centre_of(tag.x, tag.y, tag.angle)


def _centre_of(x: float, y: float, angle: float) -> tuple[float, float]:
    """The centre of the card whose tag lies at a point, turned clockwise by an angle in degrees."""
    turn = math.radians(angle)
    right, down = _TAG_TO_CENTRE
    return x + right * math.cos(turn) - down * math.sin(turn), y + right * math.sin(turn) + down * math.cos(turn)


def _spot_of(piece: Piece, x: float, y: float) -> int | None:
    """The place a piece lies at; None if it lies at none of its places."""
    spots = (
        CARD_SPOTS
        if piece.kind is PieceKind.CARD
        else [_FIRST_PASS + piece.number]
        if piece.number < len(field.pass_places())
        else []
    )
    nearest = min(spots, key=lambda spot: math.hypot(SPOTS[spot].x - x, SPOTS[spot].y - y), default=None)
    if nearest is None or math.hypot(SPOTS[nearest].x - x, SPOTS[nearest].y - y) > REACH:
        return None
    return nearest
