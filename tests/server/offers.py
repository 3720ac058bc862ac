"""Offers as real stacks write them, cut down to what matters."""

__all__ = ["FINGERPRINT", "offer", "section"]

FINGERPRINT = "sha-256 " + ":".join(["AB"] * 32)


def section(mid: str, kind: str = "video", extra: str = "", *, candidate: str = "") -> str:
    common = (
        f"c=IN IP4 0.0.0.0\r\na=mid:{mid}\r\na=ice-ufrag:abcd\r\na=ice-pwd:0123456789abcdef0123456789\r\n"
        f"a=fingerprint:{FINGERPRINT}\r\na=setup:actpass\r\n{candidate}{extra}"
    )
    if kind == "application":
        return f"m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\n{common}a=sctp-port:5000\r\n"
    codec = "96 VP8/90000" if kind == "video" else "111 opus/48000/2"
    payload = codec.split()[0]
    return f"m={kind} 9 UDP/TLS/RTP/SAVPF {payload}\r\n{common}a=recvonly\r\na=rtcp-mux\r\na=rtpmap:{codec}\r\n"


def offer(*sections: str, bundle: str | None = None) -> str:
    mids = " ".join(line[6:] for each in sections for line in each.splitlines() if line.startswith("a=mid:"))
    return (
        "v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=-\r\nt=0 0\r\n"
        f"a=group:BUNDLE {mids if bundle is None else bundle}\r\na=msid-semantic:WMS *\r\n" + "".join(sections)
    )
