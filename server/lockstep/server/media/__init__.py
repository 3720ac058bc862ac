"""Media: capture, stamp, encode once, packetise once, fan out to every peer."""
