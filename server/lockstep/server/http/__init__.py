"""HTTP: middleware, errors, bodies, the page."""
