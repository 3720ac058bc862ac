"""The robot's side of pairing: it shows that it knows the code, and checks that the console knows it too."""

import asyncio
import hashlib
import secrets
import ssl
from pathlib import Path

import msgspec
from websockets.exceptions import ConnectionClosed

from lockstep.protocol.dial_in import (
    MAX_PAIRING_MESSAGE,
    NONCE_BYTES,
    TRUSTED,
    PairingAnswer,
    PairingChallenge,
    PairingCode,
    PairingHello,
    PairingProof,
    PairingSecret,
)
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.dial.console_address import ConsoleAddress
from lockstep.robot_bridge.dial.console_connection import ConsoleConnection, console_context, open_connection
from lockstep.robot_bridge.dial.console_key import ConsoleKey
from lockstep.robot_bridge.errors import PairingRefused, WrongConsole

__all__ = ["code_digest", "pair"]

ANSWER_SECONDS = 10.0  # a console that has to guess the code does not find it in this time
UNCHECKED = "any"  # not a pin: the certificate is not checked by an authority


_answer: msgspec.msgpack.Decoder[PairingChallenge | PairingAnswer] = msgspec.msgpack.Decoder(
    PairingChallenge | PairingAnswer
)


def code_digest(code: PairingCode) -> str:
    """Return what is kept of a used code, to know it again."""
    return hashlib.sha256(f"lockstep-pair-1 used {code}".encode()).hexdigest()


async def pair(address: ConsoleAddress, code: PairingCode, robot: str, authority: Path | None) -> ConsoleKey:
    """Pair with the console and return its key, which the caller keeps.

    A certificate that no known authority vouches for is taken by its pin: the code then proves that it is the
    console's own.

    Raises:
        ConsoleUnreachable: no console answers there.
        ConsoleRefused: it does not pair now.
        PairingRefused: the code is not, or no longer, good there; or it is not the console that showed the code.
        WrongConsole: the authority that was given does not vouch for the console.
    """
    connection, pin = await _open(address, authority)
    try:
        async with asyncio.timeout(ANSWER_SECONDS):
            key = await _exchange(connection, code, robot, pin)
    except TimeoutError as error:
        raise PairingRefused("the console did not answer in time: try again") from error
    except (ConnectionClosed, msgspec.MsgspecError) as error:
        raise PairingRefused(f"the console ended the exchange: {error}") from error
    finally:
        await connection.close()
    return ConsoleKey(key, pin, address.url, code_digest(code))


async def _open(address: ConsoleAddress, authority: Path | None) -> tuple[ConsoleConnection, str]:
    url = address.path("pair")
    if not address.is_encrypted:
        return await open_connection(url, None), TRUSTED
    try:
        return await open_connection(url, console_context(TRUSTED, authority)), TRUSTED
    except WrongConsole as error:
        if authority is not None or not isinstance(error.__cause__, ssl.SSLCertVerificationError):
            raise
    connection = await open_connection(url, console_context(UNCHECKED, None))
    return connection, connection.pin


async def _exchange(connection: ConsoleConnection, code: PairingCode, robot: str, pin: str) -> LinkSecret:
    nonce = secrets.token_bytes(NONCE_BYTES)
    await _send(connection, PairingHello(place=code.place, nonce=nonce, pin=pin, robot=robot[:64]))
    challenge = await _receive(connection)
    if isinstance(challenge, PairingAnswer):
        raise PairingRefused(f"{challenge.error}: {challenge.detail}")
    secret = await asyncio.to_thread(PairingSecret, code, challenge.salt)
    await _send(connection, PairingProof(proof=secret.robot_proof(nonce, challenge.nonce, pin)))
    answer = await _receive(connection)
    if not isinstance(answer, PairingAnswer):
        raise PairingRefused("the console does not speak this protocol")
    if answer.error:
        raise PairingRefused(f"{answer.error}: {answer.detail}")
    if not LinkSecret.same(answer.proof, secret.console_proof(nonce, challenge.nonce, pin)):
        raise PairingRefused("this is not the console that showed the code; nothing was kept")
    return secret.link_key(nonce, challenge.nonce, pin)


async def _send(connection: ConsoleConnection, message: PairingHello | PairingProof) -> None:
    await connection.send(msgspec.msgpack.encode(message))


async def _receive(connection: ConsoleConnection) -> PairingChallenge | PairingAnswer:
    data = await connection.recv(decode=False)
    if len(data) > MAX_PAIRING_MESSAGE:
        raise PairingRefused("the console does not speak this protocol")
    return _answer.decode(data)
