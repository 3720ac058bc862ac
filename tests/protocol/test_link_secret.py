import hashlib
import hmac
from pathlib import Path

import pytest

from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import NONCE_BYTES, LinkSecret, draw_nonce

TEXT = "not a secret, only for tests, long enough"


def test_the_proofs_are_those_of_the_documentation() -> None:
    client, bridge = bytes(range(32)), bytes(range(32, 64))
    secret = LinkSecret(TEXT)
    assert secret.client_proof(client, bridge, "operator") == hmac.digest(
        TEXT.encode(), b"lockstep-link-1 client\0" + client + bridge + b"operator", hashlib.sha256
    )
    assert secret.bridge_proof(client, bridge, "e1") == hmac.digest(
        TEXT.encode(), b"lockstep-link-1 bridge\0" + client + bridge + b"e1", hashlib.sha256
    )


def test_a_proof_is_worth_nothing_for_another_side_role_nonce_or_secret() -> None:
    client, bridge = draw_nonce(), draw_nonce()
    secret, other = LinkSecret(TEXT), LinkSecret.draw()
    proofs = {
        secret.client_proof(client, bridge, "operator"),
        secret.client_proof(client, bridge, "media"),
        secret.client_proof(draw_nonce(), bridge, "operator"),
        secret.client_proof(client, draw_nonce(), "operator"),
        secret.bridge_proof(client, bridge, "operator"),
        other.client_proof(client, bridge, "operator"),
    }
    assert len(proofs) == 6
    assert len(draw_nonce()) == NONCE_BYTES


def test_the_secret_is_compared_shown_and_handed_on_with_care() -> None:
    secret = LinkSecret(TEXT)
    assert TEXT not in repr(secret)
    assert secret.reveal() == TEXT
    assert LinkSecret.same(b"a", b"a")
    assert not LinkSecret.same(b"a", b"b")
    assert LinkSecret.draw().reveal() != LinkSecret.draw().reveal()


def test_a_secret_comes_from_a_file_and_must_be_long_enough(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    path.write_text(f"{TEXT}\n")
    assert LinkSecret.read(path).reveal() == TEXT
    path.write_text("short")
    with pytest.raises(SecretError, match="at least 32 bytes, this one has 5"):
        LinkSecret.read(path)
    path.write_bytes(b"\xff" * 64)
    with pytest.raises(SecretError, match="cannot read"):
        LinkSecret.read(path)
    with pytest.raises(SecretError, match="cannot read"):
        LinkSecret.read(tmp_path / "none")
