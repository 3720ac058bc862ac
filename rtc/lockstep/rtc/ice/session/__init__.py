"""One ICE session: the checks of both sides, the pair that they select, and consent to send on it."""
