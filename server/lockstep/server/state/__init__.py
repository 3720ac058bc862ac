"""The state of a console: its state directory, the context that its robots share, the routes' dependencies."""
