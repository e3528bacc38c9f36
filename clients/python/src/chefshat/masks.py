"""Batches of masks of legal actions: bit i%8 of byte i//8 is action i."""

import numpy as np
from numpy.typing import NDArray

# Constants of the parallel bit count in 64-bit words, by pairs, by fours, by bytes; and one in every byte.
_PAIRS = np.uint64(0x5555555555555555)
_FOURS = np.uint64(0x3333333333333333)
_BYTES = np.uint64(0x0F0F0F0F0F0F0F0F)
_ONES = np.uint64(0x0101010101010101)
_TOPS = np.uint64(0x8080808080808080)


def _positions() -> NDArray[np.uint16]:
    """Returns at b * 8 + k the position of the k-th set bit of byte b, from 0; 0 if it has fewer set bits."""
    table = np.zeros((256, 8), np.uint16)
    for byte in range(256):
        bits = [bit for bit in range(8) if byte >> bit & 1]
        table[byte, : len(bits)] = bits
    return table.reshape(-1)


_POSITIONS = _positions()


def unpack(mask_bits: NDArray[np.uint8], num_actions: int) -> NDArray[np.bool_]:
    """Unpacks masks to booleans.

    Args:
        mask_bits: (R, ceil(A/8)).
        num_actions: A.

    Returns:
        (R, A), read-only.
    """
    masks = np.unpackbits(mask_bits, axis=1, count=num_actions, bitorder="little").view(np.bool_)
    masks.flags.writeable = False
    return masks


def is_legal(mask_bits: NDArray[np.uint8], actions: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Returns whether each row's action is legal by its mask, (R,)."""
    rows = np.arange(len(mask_bits))
    return np.asarray(mask_bits[rows, actions >> 3] >> (actions & 7).astype(np.uint8) & 1, np.bool_)


def sample_legal(mask_bits: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint16]:
    """Draws one legal action for each row, uniformly.

    Args:
        mask_bits: (R, ceil(A/8)), at least one bit set in every row, no bit from A on.
        rng: the random generator; one draw for each row.

    Returns:
        (R,): the actions.

    Raises:
        ValueError: a row has no legal action.
    """
    words, upto = _words(mask_bits)
    # The rank of the drawn bit, from 0.
    return _nth(words, upto, (rng.random(len(words)) * upto[:, -1]).astype(np.uint64))


def sample_by(mask_bits: NDArray[np.uint8], seed: int, first: int) -> NDArray[np.uint16]:
    """Draws one legal action for each row, uniformly, by a sequence that every implementation has in common.

    Row i takes the draw `first + i` of SplitMix64 with this seed; its upper 32 bits are scaled to the number of legal actions.

    Args:
        mask_bits: as in `sample_legal`.
        seed: the seed, 0..2**64-1.
        first: the number of the first draw, from 0.
    """
    words, upto = _words(mask_bits)
    with np.errstate(over="ignore"):
        state = np.arange(first + 1, first + 1 + len(words), dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(seed)
        state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        state ^= state >> np.uint64(31)
    return _nth(words, upto, (state >> np.uint64(32)) * upto[:, -1] >> np.uint64(32))


def _words(mask_bits: NDArray[np.uint8]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Returns masks as 64-bit words, and the set bits up to and including each word."""
    rows, width = mask_bits.shape
    words_wide = -(-width // 8)
    padded = np.zeros((rows, words_wide * 8), np.uint8)
    padded[:, :width] = mask_bits
    words = padded.view("<u8")
    upto = np.bitwise_count(words).astype(np.uint64)
    for word in range(1, words_wide):
        upto[:, word] += upto[:, word - 1]
    total = upto[:, -1]
    if not total.all():
        raise ValueError(f"row {int(total.argmin())} has no legal action")
    return words, upto


def _nth(words: NDArray[np.uint64], upto: NDArray[np.uint64], rank: NDArray[np.uint64]) -> NDArray[np.uint16]:
    """Returns in each row the set bit of this rank, from 0."""
    rows, words_wide = words.shape
    # The word it is in, and its rank within that word.
    wanted = np.zeros(rows, np.intp)
    for before in range(words_wide - 1):
        wanted += upto[:, before] <= rank
    at = np.arange(0, rows * words_wide, words_wide) + wanted
    rank -= upto.reshape(-1)[at] - np.bitwise_count(words.reshape(-1)[at])
    chosen = words.reshape(-1)[at]
    # Byte b of `sums` counts the set bits of the bytes up to b.
    sums = chosen - (chosen >> np.uint64(1) & _PAIRS)
    sums = (sums & _FOURS) + (sums >> np.uint64(2) & _FOURS)
    sums = (sums + (sums >> np.uint64(4)) & _BYTES) * _ONES
    # Byte b of `full` has its top bit set if at most `rank` bits are in the bytes up to b, that is before the byte wanted.
    full = ((rank * _ONES | _TOPS) - sums) & _TOPS
    shift = np.bitwise_count(full).astype(np.uint64) << np.uint64(3)
    rank -= (sums << np.uint64(8)) >> shift & np.uint64(0xFF)
    byte = chosen >> shift & np.uint64(0xFF)
    within = _POSITIONS[(byte << np.uint64(3) | rank).astype(np.intp)]
    return np.asarray((wanted << 6) + shift.astype(np.intp) + within, np.uint16)
