"""Interactive Connectivity Establishment (RFC 8445), and many agents on one UDP port."""
