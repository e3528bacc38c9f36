"""Checks the deals of a record by the formulas in `event.proto` (SeedReveal), without any code of this project."""

import base64
import json
import struct
from collections.abc import Iterator
from hashlib import sha256
from typing import Any

from cryptography.hazmat.primitives.ciphers import Cipher
from cryptography.hazmat.primitives.ciphers.algorithms import ChaCha20


def game_seed(header: dict[str, Any], reveal: dict[str, Any]) -> bytes:
    """The game seed; fails if the revealed seed is not the one committed to."""
    server_seed, nonce = base64.b64decode(reveal["serverSeed"]), base64.b64decode(reveal["nonce"])
    committed = sha256(b"chefshat.v1 seed" + bytes.fromhex(header["gameId"]) + nonce + server_seed).digest()
    assert committed == base64.b64decode(header["seedCommitment"]), "the server did not keep to its commitment"
    parts = [base64.b64decode(part) for part in reveal["seatEntropy"]]
    return sha256(b"chefshat.v1 game" + server_seed + b"".join(bytes([len(part)]) + part for part in parts)).digest()


def hands(seed: bytes, shift: int, players: int, faces: int, jokers: int) -> list[dict[str, Any]]:
    """The hands of a Shift, as the record has them."""
    stream = Cipher(ChaCha20(seed, struct.pack("<QQ", 0, shift)), None).encryptor()
    words: Iterator[int] = iter(lambda: int.from_bytes(stream.update(bytes(4)), "little"), -1)

    def below(n: int) -> int:
        return next(word for word in words if word < (1 << 32) // n * n) % n

    golden = 0  # the code of the Golden card; a joker has the number after the top face
    deck = [face for face in range(1, faces + 1) for _ in range(face)][:-1] + [golden] + [faces + 1] * jokers
    for last in range(len(deck) - 1, 0, -1):
        other = below(last + 1)
        deck[last], deck[other] = deck[other], deck[last]
    dealt = len(deck) // players * players
    if golden in deck[dealt:]:
        aside, other = deck.index(golden), below(dealt)
        deck[aside], deck[other] = deck[other], deck[aside]
    size = dealt // players
    shares = [deck[seat * size : (seat + 1) * size] for seat in range(players)]
    return [{"cards": sorted(card or faces for card in share), "golden": golden in share} for share in shares]


def check_deals(path: str) -> int:
    """Deals all Shifts of a record again; returns how many there were."""
    with open(path, encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    header, rules, events = lines[0]["header"], lines[0]["header"]["rules"], [line.get("event", {}) for line in lines]
    seed = game_seed(header, next(event["gameEnded"] for event in events if "gameEnded" in event)["reveal"])
    shifts = [event["shiftStarted"] for event in events if "shiftStarted" in event]
    for shift in shifts:
        recorded = [{"cards": hand["cards"], "golden": hand.get("golden", False)} for hand in shift["hands"]]
        dealt = hands(seed, shift["shift"], rules["players"], rules["faces"], rules.get("jokers", 0))
        assert recorded == dealt, f"Shift {shift['shift']} was not dealt from the seed"
    return len(shifts)
