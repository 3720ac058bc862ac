import datetime
from pathlib import Path

import httpx
import pytest
from cryptography import x509

from lockstep.client import Console
from lockstep.client.errors import ConnectFailed
from lockstep.server.http.transport.tls import fingerprint, own_names, self_signed
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
