from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_file_that_is_called_slow_exists_once_and_in_order() -> None:
    named = (ROOT / "tests" / "slow.txt").read_text().split()
    assert named == sorted(set(named))
    assert [name for name in named if not (ROOT / name).is_file()] == []
