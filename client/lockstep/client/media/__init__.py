"""Turns RTP packets into pictures and sounds that carry their event."""
