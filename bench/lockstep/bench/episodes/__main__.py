from lockstep.bench.episodes.cli import app

app()
