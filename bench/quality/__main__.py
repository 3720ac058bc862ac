from bench.quality.cli import app

app()
