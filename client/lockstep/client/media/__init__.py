"""From RTP packets to pictures and sounds that carry their event."""
