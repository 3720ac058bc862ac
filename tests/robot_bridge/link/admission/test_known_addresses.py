from pathlib import Path

from lockstep.robot_bridge.link.admission.known_addresses import LIMIT, KnownAddresses


def test_addresses_are_known_by_their_network_and_after_a_restart(tmp_path: Path) -> None:
    before = KnownAddresses(tmp_path / "addresses.txt")
    assert before.add("192.0.2.1")
    assert before.add("2001:db8::1")
    assert not before.add("2001:db8::2")
    before.write()
    after = KnownAddresses(tmp_path / "addresses.txt")
    assert "192.0.2.1" not in after
    after.read()
    assert "192.0.2.1" in after
    assert "2001:db8::3" in after
    assert "192.0.2.2" not in after


def test_the_newest_are_kept(tmp_path: Path) -> None:
    known = KnownAddresses(tmp_path / "addresses.txt")
    for number in range(LIMIT):
        known.add(f"192.0.2.{number}")
    known.add("192.0.2.0")
    known.add("198.51.100.1")
    known.write()
    known = KnownAddresses(tmp_path / "addresses.txt")
    known.read()
    assert [f"192.0.2.{number}" in known for number in range(3)] == [True, False, True]
    assert "198.51.100.1" in known


def test_a_file_that_is_missing_damaged_or_cannot_be_written_is_none(tmp_path: Path) -> None:
    path = tmp_path / "addresses.txt"
    KnownAddresses(path).read()
    path.write_bytes(b"\xff\0\n" * 10_000)
    KnownAddresses(path).read()
    gone = KnownAddresses(tmp_path / "no" / "addresses.txt")
    gone.add("192.0.2.1")
    gone.write()
    nowhere = KnownAddresses(None)
    nowhere.add("192.0.2.1")
    nowhere.write()
    nowhere.read()
    assert "192.0.2.1" in nowhere
