"""The commands about recordings and their episodes."""
