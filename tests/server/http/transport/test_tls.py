import datetime
import ssl
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import httpx
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from lockstep.client import Console
from lockstep.client.errors import ConnectFailed
from lockstep.server.http.transport.tls import Certificate, fingerprint, own_names, self_signed, shown_by, trusting
from lockstep.server.settings import Settings
from tests.server.rig import running_bridge, running_console

NOW = datetime.datetime(2026, 6, 1, tzinfo=datetime.UTC)
NAMES = {"robot.example", "192.0.2.7", "2001:db8::7"}


def test_a_certificate_names_what_the_console_goes_by(tmp_path: Path) -> None:
    made = self_signed(tmp_path / "state", NAMES, NOW)
    names = x509.load_pem_x509_certificate(made.chain.read_bytes()).extensions.get_extension_for_class(
        x509.SubjectAlternativeName
    )
    assert names.value.get_values_for_type(x509.DNSName) == ["robot.example"]
    assert {str(each) for each in names.value.get_values_for_type(x509.IPAddress)} == {"192.0.2.7", "2001:db8::7"}
    assert made.key.stat().st_mode & 0o777 == 0o600
    assert len(fingerprint(made)) == 95


def test_it_stays_the_same_while_it_is_good(tmp_path: Path) -> None:
    first = self_signed(tmp_path, NAMES, NOW).chain.read_bytes()
    assert self_signed(tmp_path, {"robot.example"}, NOW + datetime.timedelta(days=300)).chain.read_bytes() == first


def test_it_is_made_anew_when_it_ends_soon_or_lacks_a_name_or_is_damaged(tmp_path: Path) -> None:
    def again(names: set[str], now: datetime.datetime) -> bytes:
        return self_signed(tmp_path, names, now).chain.read_bytes()

    seen = {again(NAMES, NOW)}
    seen.add(again(NAMES, NOW + datetime.timedelta(days=380)))
    seen.add(again(NAMES | {"another.example"}, NOW))
    (tmp_path / "tls-key.pem").write_text("rubbish")
    seen.add(again(NAMES, NOW))
    (tmp_path / "tls-cert.pem").unlink()
    seen.add(again(NAMES, NOW))
    assert len(seen) == 5


def test_a_console_on_all_interfaces_does_not_put_that_into_its_certificate() -> None:
    assert "0.0.0.0" not in own_names("0.0.0.0")
    assert {"127.0.0.1", "localhost", "192.0.2.7"} <= own_names("192.0.2.7")


class Issued(NamedTuple):
    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def issue(name: str, by: Issued | None = None, *, authority: bool = False) -> Issued:
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject if by is None else by.certificate.subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(minutes=5))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.BasicConstraints(ca=authority, path_length=None), critical=True)
        .sign(key if by is None else by.key, hashes.SHA256())
    )
    return Issued(made, key)


def files(directory: Path, chain: list[Issued]) -> Certificate:
    directory.mkdir()
    pem = serialization.Encoding.PEM
    made = Certificate(directory / "chain.pem", directory / "key.pem")
    made.chain.write_bytes(b"".join(each.certificate.public_bytes(pem) for each in chain))
    kind, none = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    made.key.write_bytes(chain[0].key.private_bytes(pem, kind, none))
    return made


def shakes_hands(client: ssl.SSLContext, served: Certificate) -> bool:
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(served.chain, served.key)
    here, there = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = client.wrap_bio(here, there), server.wrap_bio(there, here, server_side=True)
    for _ in range(5):
        for end in ends:
            with suppress(ssl.SSLWantReadError):
                try:
                    end.do_handshake()
                except ssl.SSLCertVerificationError:
                    return False
    return ends[0].getpeercert(binary_form=True) is not None


def test_who_trusts_a_certificate_takes_it_with_its_chain_and_no_other_of_the_same_authority(tmp_path: Path) -> None:
    authority = issue("authority", authority=True)
    between = issue("between", authority, authority=True)
    own = files(tmp_path / "own", [issue("console", between), between])
    other = files(tmp_path / "other", [issue("console", between), between])
    trusted = trusting(shown_by(own))
    assert shakes_hands(trusted, own)
    assert not shakes_hands(trusted, other)
    assert not shakes_hands(trusted, self_signed(tmp_path / "made", NAMES, datetime.datetime.now(datetime.UTC)))


def test_text_that_is_no_certificate_is_trusted_by_nobody() -> None:
    with pytest.raises(ValueError, match="no certificate"):
        trusting("-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n")


async def test_a_console_with_tls_answers_who_trusts_its_certificate_and_nobody_in_clear(tmp_path: Path) -> None:
    certificate = self_signed(tmp_path, {"127.0.0.1"}, datetime.datetime.now(datetime.UTC))
    async with (
        running_bridge() as bridge,
        running_console(bridge.address[1], certificate=certificate, scene=True) as rig,
        httpx.AsyncClient(trust_env=False) as doubting,
    ):
        assert rig.url.startswith("https://")
        assert (await rig.http.get("/healthz")).status_code == 200
        scene = await rig.http.post("/api/scene", headers=rig.token("observer"))
        assert "websocket=wss://127.0.0.1" in scene.json()["path"]
        with pytest.raises(httpx.ConnectError):
            await doubting.get(f"{rig.url}/healthz")
        with pytest.raises(httpx.RemoteProtocolError):
            await doubting.get(f"{rig.url.replace('https', 'http')}/healthz")


async def test_the_headless_client_trusts_the_certificate_that_it_is_given(tmp_path: Path) -> None:
    certificate = self_signed(tmp_path, {"127.0.0.1"}, datetime.datetime.now(datetime.UTC))
    async with running_bridge() as bridge, running_console(bridge.address[1], certificate=certificate) as rig:
        link = f"{rig.url}/#token={rig.access.issue('operator', 'operator')}"
        async with Console(link, video=False, audio=False, tls_ca=certificate.chain) as console:
            assert console.feedback is not None
        with pytest.raises(ConnectFailed, match="CERTIFICATE_VERIFY_FAILED"):
            async with Console(link, video=False, audio=False):
                pass


async def test_only_a_certificate_that_browsers_trust_makes_them_insist_on_tls() -> None:
    async with running_bridge() as bridge:
        async with running_console(bridge.address[1], tls="self-signed") as rig:
            assert "strict-transport-security" not in (await rig.http.get("/healthz")).headers
        async with running_console(bridge.address[1], tls_cert=__file__, tls_key=__file__) as rig:
            assert (await rig.http.get("/healthz")).headers["strict-transport-security"] == "max-age=31536000"


def test_the_settings_know_whether_anything_is_encrypted() -> None:
    assert not Settings().encrypted
    assert Settings(tls="self-signed").encrypted
