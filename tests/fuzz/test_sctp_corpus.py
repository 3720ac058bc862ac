"""The inputs that fuzzing SCTP begins with are in the corpus."""

from tests.fuzz.parsers.sctp import SCENES
from tests.fuzz.seeds_sctp import CORPUS, seeds


def test_every_seed_is_in_the_corpus_in_every_scene() -> None:
    names = {path.name for path in CORPUS.iterdir()}
    assert {f"{name}-{scene}" for name in seeds() for scene in range(len(SCENES))} <= names
