"""Endless mutations of a corpus, the same for the same seed."""

from collections.abc import Callable, Iterator, Sequence
from random import Random

__all__ = ["mutations"]

MAX_LENGTH = 16_384
Mutator = Callable[[Random, bytearray, Sequence[bytes]], None]


def mutations(corpus: Sequence[bytes], seed: int) -> Iterator[bytes]:
    random = Random(seed)
    while True:
        data = bytearray(random.choice(corpus))
        for _ in range(random.choice((1, 1, 2, 3, 8))):
            random.choice(MUTATORS)(random, data, corpus)
        yield bytes(data[:MAX_LENGTH])


def flip(random: Random, data: bytearray, corpus: Sequence[bytes]) -> None:
    if data:
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)


def overwrite(random: Random, data: bytearray, corpus: Sequence[bytes]) -> None:
    if data:
        at = random.randrange(len(data))
        data[at : at + 4] = random.choice((b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", random.randbytes(4)))


def insert(random: Random, data: bytearray, corpus: Sequence[bytes]) -> None:
    at = random.randint(0, len(data))
    data[at:at] = random.randbytes(random.choice((1, 2, 4, 40)))


def remove(random: Random, data: bytearray, corpus: Sequence[bytes]) -> None:
    at = random.randint(0, len(data))
    del data[at : at + random.choice((1, 2, 4, 40))]


def repeat(random: Random, data: bytearray, corpus: Sequence[bytes]) -> None:
    start, end = sorted((random.randint(0, len(data)), random.randint(0, len(data))))
    data[end:end] = data[start:end]


def splice(random: Random, data: bytearray, corpus: Sequence[bytes]) -> None:
    """The rest of another input; its first byte chooses the scene and stays behind."""
    at = random.randint(0, len(data))
    data[at:at] = random.choice(corpus)[1:]


MUTATORS: tuple[Mutator, ...] = (flip, overwrite, insert, remove, repeat, splice)
