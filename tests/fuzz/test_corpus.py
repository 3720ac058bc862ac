"""The corpus of every fuzz target, and a fixed number of its mutations. `make fuzz` goes on for longer."""

from itertools import islice

import pytest

from tests.fuzz.mutation import MAX_LENGTH, mutations
from tests.fuzz.seeds import CORPUS, SCENES, seeds
from tests.fuzz.targets import TARGETS, corpus

MUTATIONS = 300
SEED = 20_251_121


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_every_input_of_the_corpus_is_withstood(target: str) -> None:
    attempt = TARGETS[target].load()
    for name, data in corpus(target).items():
        try:
            attempt(data)
        except Exception as error:
            raise AssertionError(f"{name}: {error}") from error


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_mutations_of_the_corpus_are_withstood(target: str) -> None:
    attempt = TARGETS[target].load()
    for data in islice(mutations(list(corpus(target).values()), SEED), MUTATIONS):
        try:
            attempt(data)
        except Exception as error:
            raise AssertionError(f"{data!r}: {error}") from error


def test_mutations_repeat_and_are_bounded() -> None:
    inputs = [b"abcdef", b"123", b""]
    first = list(islice(mutations(inputs, 1), 500))
    assert first == list(islice(mutations(inputs, 1), 500))
    assert len(set(first)) > 300
    assert max(map(len, mutated_long())) <= MAX_LENGTH


def mutated_long() -> list[bytes]:
    return list(islice(mutations([bytes(MAX_LENGTH)], 1), 100))


def test_every_seed_of_the_robot_link_is_in_the_corpus_in_every_scene() -> None:
    names = {path.name for path in CORPUS.iterdir()}
    assert {f"{name}-{scene}" for name in seeds() for scene in range(SCENES)} <= names
