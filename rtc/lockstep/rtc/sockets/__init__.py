"""The shells of the endpoint: UDP, TCP, links to STUN and TURN servers, and the connections with their clock."""
