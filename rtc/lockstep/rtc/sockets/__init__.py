"""The shells of the endpoint: UDP, TCP, sockets to STUN and TURN servers, and the connections with their clock."""
