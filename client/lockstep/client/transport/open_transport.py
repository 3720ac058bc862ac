"""Chooses the transport to a console, and negotiates it."""

import asyncio
from collections.abc import Callable

from lockstep.client.connection_options import ConnectionOptions
from lockstep.client.errors import SignallingRefused
from lockstep.client.shielded_close import finish
from lockstep.client.transport.sdp import Section
from lockstep.client.transport.transport import Transport
from lockstep.client.transport.webrtc_transport import WebRtcTransport
from lockstep.client.transport.websocket_transport import WebSocketBlocked, WebSocketTransport

__all__ = ["open_transport"]

RETRY_SECONDS = 1.0  # between two tries while the console does not reach its robot; as in its Retry-After


async def open_transport(
    options: ConnectionOptions, on_message: Callable[[str | bytes], None], deadline: float, *, beside: str = ""
) -> tuple[Transport, list[Section]]:
    """Return a negotiated transport and its media sections.

    Retries while the console does not reach its robot.

    Args:
        options: of the connection
        on_message: called with each message
        deadline: time of the last try, on the loop's clock
        beside: the relay that media come from, which leaves a WebSocket for the rest, or data channels where no
            WebSocket passes; "": the console

    Raises:
        SignallingRefused, ConnectFailed: as `Whep.offer`.
    """
    loop = asyncio.get_running_loop()
    transport: Transport
    if beside:
        transport = WebSocketTransport(options.link, beside, options.tls_ca, on_message, options.silence_seconds)
    else:
        transport = _webrtc(options, on_message, "")
    while True:
        try:
            return transport, await transport.negotiate()
        except WebSocketBlocked:
            wait = 0.0
            await transport.close()
        except SignallingRefused as error:
            wait = RETRY_SECONDS
            await finish(transport.close())
            if error.error != "robot_unreachable" or loop.time() + wait > deadline:
                raise
        except BaseException:
            await finish(transport.close())
            raise
        await asyncio.sleep(wait)
        transport = _webrtc(options, on_message, beside)


def _webrtc(options: ConnectionOptions, on_message: Callable[[str | bytes], None], relay: str) -> WebRtcTransport:
    return WebRtcTransport(
        options.link,
        carrier=options.carrier,
        video=options.video,
        audio=options.audio,
        codec=options.codec,
        route=options.route,
        tls_ca=options.tls_ca,
        relay_only=options.relay_only,
        on_message=on_message,
        relay=relay,
        sound_codec=options.sound_codec,
    )
