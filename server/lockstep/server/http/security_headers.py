"""Security headers, and the check of a request's origin."""

import re
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lockstep.server.errors import OriginRefused
from lockstep.server.http.robot_paths import below_robot

__all__ = ["FILE_POLICY", "PAGE_POLICY", "SCENE_POLICY", "SecurityHeaders", "check_origin", "scene_policy"]

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

# The page loads only its own files; its workers may also come from blobs. Styles may be set on elements. A page with
# inline scripts names their hashes, in a policy of this directive alone (`static_files.script_policy`).
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; worker-src 'self' blob:; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; media-src 'self' blob:; font-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

# Responses other than documents, such as scripts and API answers, load nothing: a policy as long as the page's on each
# would be a twentieth of the bytes that opening a page takes. It also binds SVG, and files opened by their address.
FILE_POLICY = "default-src 'none'; frame-ancestors 'none'"

# viser's client is one HTML file: inline script, script made from text, WebAssembly, workers and fonts from data and
# blob URLs. So it has an opaque origin without storage, token or rights (`sandbox` without allow-same-origin), and may
# connect to its stream alone.
SCENE_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
    "connect-src {stream}; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)

SCRIPTS = "script-src 'self'"
HASHED_SCRIPTS = re.compile(rf"{SCRIPTS}( 'sha256-[A-Za-z0-9+/]{{43}}=')+")
HOST = re.compile(r"[\w.:\[\]-]+", re.ASCII)  # a host that may stand in a policy

HEADERS = {
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",  # for browsers that do not know frame-ancestors
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Permitted-Cross-Domain-Policies": "none",
}
# For documents alone (Permissions Policy, 4.1).
PERMISSIONS = (
    "gamepad=(self), fullscreen=(self), screen-wake-lock=(self), clipboard-write=(self), autoplay=(self), "
    "microphone=(self), camera=(), geolocation=(), usb=(), serial=(), hid={hid}, midi=(), payment=(), "
    "display-capture=(), browsing-topics=()"
)
DOCUMENTS = ("text/html", "application/xhtml+xml")
HSTS = "max-age=31536000"  # RFC 6797; without sub-domains, which may be somebody else's


class SecurityHeaders:
    """A middleware that adds the headers to every HTTP response."""

    def __init__(
        self, app: ASGIApp, lasting_tls: bool = False, relays: tuple[str, ...] = (), hid: bool = False
    ) -> None:
        """`lasting_tls`: browsers trust the certificate, so they may insist on TLS from now on.

        `relays`: WebSocket origins that the page connects to besides its own. `hid`: the page may ask for HID devices
        (WebHID), to drive force-feedback sticks.
        """
        self._app = app
        self._page_policy = PAGE_POLICY.replace("connect-src 'self'", " ".join(("connect-src 'self'", *relays)))
        self._permissions = PERMISSIONS.format(hid="(self)" if hid else "()")
        self._headers = HEADERS | ({"Strict-Transport-Security": HSTS} if lasting_tls else {})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        of_scene = below_robot(scope["path"]).startswith("/scene/")

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                own = headers.get("Content-Security-Policy", "")
                is_document = headers.get("content-type", "").startswith(DOCUMENTS)
                policy = self._policy_with(own) if is_document else FILE_POLICY
                headers["Content-Security-Policy"] = scene_policy(scope) if of_scene else policy
                if is_document:
                    headers["Permissions-Policy"] = self._permissions
                for name, value in self._headers.items():
                    headers[name] = value
            await send(message)

        await self._app(scope, receive, send_with_headers)

    def _policy_with(self, scripts: str) -> str:
        """Return the page's policy with the hashes of its inline scripts."""
        return self._page_policy.replace(SCRIPTS, scripts) if HASHED_SCRIPTS.fullmatch(scripts) else self._page_policy


def scene_policy(scope: Scope) -> str:
    """Return the policy of the 3D scene, whose stream is on the host that its page came from."""
    host = Headers(scope=scope).get("host", "")
    scheme = "wss" if scope["scheme"] == "https" else "ws"
    return SCENE_POLICY.format(stream=f"{scheme}://{host}" if HOST.fullmatch(host) else "'none'")


def check_origin(headers: Headers, allowed: tuple[str, ...]) -> None:
    """Check the Origin of a browser's request: only the console's pages and the allowed ones may change anything.

    Raises:
        OriginRefused: the request comes from another site's page.
    """
    origin = headers.get("origin")
    if origin is None or origin in allowed:
        return  # not from a browser, or from an allowed page
    try:
        site = urlsplit(origin).netloc
    except ValueError as error:  # "http://["
        raise OriginRefused("the Origin header is not valid") from error
    if site != headers.get("host"):
        raise OriginRefused("requests from pages of other sites are refused")
