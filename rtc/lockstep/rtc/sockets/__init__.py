"""The sockets of the endpoint: UDP, TCP, and links to TURN servers."""
