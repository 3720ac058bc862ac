from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from lockstep.server.evidence.signer import KEY_FILE, evidence_signer, is_public_key, is_signed
from lockstep.server.util.state_dir import StateDamaged, StateDir


def test_the_key_is_made_once_kept_and_for_its_owner_alone(tmp_path: Path) -> None:
    first, second = evidence_signer(StateDir(tmp_path)), evidence_signer(StateDir(tmp_path))
    assert first.public_key == second.public_key
    assert is_public_key(first.public_key)
    assert (tmp_path / KEY_FILE).stat().st_mode & 0o777 == 0o600
    assert first.public_key not in (tmp_path / KEY_FILE).read_text()


def test_what_was_signed_is_told_from_everything_else(tmp_path: Path) -> None:
    signer = evidence_signer(StateDir(tmp_path / "a"))
    other = evidence_signer(StateDir(tmp_path / "b"))
    signature = signer.sign(b"text")
    assert is_signed(signer.public_key, b"text", signature)
    assert not is_signed(signer.public_key, b"Text", signature)
    assert not is_signed(other.public_key, b"text", signature)
    for rubbish in ("", "zz" * 64, signature[:-1], signature + "0", "0" * 128):
        assert not is_signed(signer.public_key, b"text", rubbish)
    assert not is_signed("f" * 64, b"text", signature)


@pytest.mark.parametrize("other", [False, True])
def test_a_file_that_is_no_ed25519_key_is_named(tmp_path: Path, other: bool) -> None:
    key = X25519PrivateKey.generate().private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    (tmp_path / KEY_FILE).write_bytes(key if other else b"rubbish")
    with pytest.raises(StateDamaged, match="evidence.key"):
        evidence_signer(StateDir(tmp_path))
