from lockstep.bench.quality.cli import app

app()
