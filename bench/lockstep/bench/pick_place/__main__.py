from lockstep.bench.pick_place.cli import app

app()
