"""The client's side of TURN (RFC 8656) and STUN servers, as cores without I/O."""
