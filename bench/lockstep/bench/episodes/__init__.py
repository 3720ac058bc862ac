"""Episodes of the SO-101 by several drivers through a network, and their dataset (docs/episodes.md)."""
