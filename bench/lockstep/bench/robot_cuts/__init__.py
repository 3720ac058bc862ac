"""A robot whose own network is cut again and again: how it rests, and how soon it is driven again."""
