"""The parts of a peer: what it says of itself, and the media of its one BUNDLE."""
