"""WebRTC over HTTP: WHEP, WHIP, ICE servers and the SFU."""
