"""Every seed of WHEP and the data channels is in the corpus."""

from tests.fuzz.seeds_console import CORPUS, channel_seeds, sdp_seeds


def test_every_seed_is_in_the_corpus() -> None:
    for folder, seeds in (("sdp", sdp_seeds()), ("channels", channel_seeds())):
        kept = {path.name.rpartition("-")[0]: path.read_bytes()[1:] for path in (CORPUS / folder).iterdir()}
        for name, data in seeds.items():
            assert kept.get(name) == data, f"run python -m tests.fuzz.seeds_console: {folder}/{name}"
