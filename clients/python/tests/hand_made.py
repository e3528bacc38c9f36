"""Random columns of observations, for tests and fixtures that need no server. They need not be reachable in a game."""

import numpy as np

from chefshat import pb
from chefshat.columns import Observations, Sizes
from chefshat.learn import features
from chefshat.learn.features import Bytes
from chefshat.learn.network import Network


class HandMade(Observations):
    """Columns of observations, and of their decisions."""

    seats: Bytes
    kinds: Bytes
    mask_bits: Bytes

    def default_actions(self) -> list[int]:
        """Returns the default action of each row, which a server sends with the request."""
        turns = features.turn_actions(self.sizes.faces)
        found = []
        for row, kind in enumerate(self.kinds):
            legal = np.flatnonzero(np.unpackbits(self.mask_bits[row], bitorder="little"))
            plain = self.hands[row].copy()
            plain[self.sizes.faces - 1] -= self.golden[row]
            held = np.flatnonzero(plain[: self.sizes.faces])
            gift = held[-1] if len(held) else self.sizes.faces - 1 if self.golden[row] else self.sizes.faces
            wanted = {pb.DECISION_KIND_TURN: turns - 1, pb.DECISION_KIND_EXCHANGE: turns + gift}.get(
                kind, turns + self.sizes.faces + 1
            )
            found.append(int(wanted if wanted in legal else legal[0]))
        return found

    def actions(self, network: Network) -> list[int]:
        """Returns the action of a network agent in each row."""
        chosen = network.actions(self, self.seats, self.kinds, self.mask_bits)
        if network.info.output == "actions":
            return [int(action) for action in chosen]
        turns = self.kinds == pb.DECISION_KIND_TURN
        return [int(action) for action in np.where(turns, chosen, self.default_actions())]


def hand_made(rows: int, *, seed: int, players: int = 4, faces: int = 11, jokers: int = 2) -> HandMade:
    """Draws rows consistent with the deck, the seat's number of cards and the decision kind, and otherwise arbitrary."""
    chance = np.random.default_rng(seed)
    deck = np.repeat(np.arange(faces + 1), [*range(1, faces + 1), jokers])
    size = features.dealt(players, faces, jokers)
    turns, actions = features.turn_actions(faces), features.num_actions(faces)

    def counted(cards: np.ndarray) -> Bytes:
        return np.bincount(cards, minlength=faces + 1).astype(np.uint8)

    hands, played, gave, received, boards, masks = [], [], [], [], [], []
    kinds = chance.integers(1, 4, rows, dtype=np.uint8)
    for kind in kinds:
        shuffled = chance.permutation(deck)
        held = int(chance.integers(1, size + 1))
        hands.append(counted(shuffled[:held]))
        played.append(counted(shuffled[held : held + int(chance.integers(0, len(deck) - held))]))
        gave.append(counted(shuffled[: chance.integers(0, 3)]))
        received.append(counted(shuffled[-1 - int(chance.integers(0, 2)) :]))
        face = int(chance.integers(0, faces + 2))
        joker = int(chance.integers(0, jokers + 1))
        boards.append([0, 0, 0] if face == 0 else [face, 1, 1] if face == faces + 1 else [face, 1 + joker, joker])
        if kind == pb.DECISION_KIND_TURN:
            low, high = 0, turns
        elif kind == pb.DECISION_KIND_EXCHANGE:
            low, high = turns, turns + faces + 1
        else:
            low, high = turns + faces + 1, actions
        mask = np.zeros(actions, np.uint8)
        mask[low:high] = chance.random(high - low) < 0.2
        mask[chance.integers(low, high)] = 1
        masks.append(np.packbits(mask, bitorder="little"))
    hand = np.array(hands)
    seats = chance.integers(0, players, rows, dtype=np.uint8)
    cards_left = chance.integers(0, size + 1, (rows, players), dtype=np.uint8)
    cards_left[np.arange(rows), seats] = hand.sum(axis=1)
    columns = {
        "pizzas": chance.integers(0, 45, rows, dtype=np.uint32),
        "hands": hand,
        "golden": ((hand[:, faces - 1] > 0) & (chance.random(rows) < 0.5)).astype(np.uint8),
        "boards": np.array(boards, np.uint8),
        "cards_left": cards_left,
        "passed": chance.integers(0, 2, (rows, players), dtype=np.uint8),
        "places": chance.integers(0, players + 1, (rows, players), dtype=np.uint8),
        "roles": chance.integers(0, 6, (rows, players), dtype=np.uint8),
        "points": chance.integers(0, 25, (rows, players), dtype=np.uint32),
        "played": np.array(played),
        "gave": np.array(gave),
        "received": np.array(received),
        "seats": seats,
        "kinds": kinds,
        "mask_bits": np.array(masks),
    }
    return HandMade.of(rows, Sizes(players, faces, jokers, size, actions, turns), columns)
