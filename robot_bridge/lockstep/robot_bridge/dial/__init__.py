"""The robot dials its console: TLS, a WebSocket for each link, a key of its own (docs/robot-link.md)."""
