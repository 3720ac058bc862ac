from pathlib import Path

from lockstep.server.cli.make_secrets import NAMES, main, make_secrets


def test_missing_secrets_are_made_long_and_different(tmp_path: Path) -> None:
    assert make_secrets(tmp_path) == list(NAMES)
    made = {(tmp_path / name).read_text() for name in NAMES}
    assert len(made) == len(NAMES)
    assert all(len(secret) >= 43 for secret in made)


def test_a_secret_that_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / NAMES[0]).parent.mkdir()
    (tmp_path / NAMES[0]).write_text("known")
    assert make_secrets(tmp_path) == [NAMES[1]]
    assert (tmp_path / NAMES[0]).read_text() == "known"


def test_without_a_folder_it_says_how_it_is_used(tmp_path: Path) -> None:
    assert main([]) == 2
    assert main([str(tmp_path / "nowhere")]) == 2
    assert main([str(tmp_path)]) == 0
