from lockstep.bench.uplink.cli import app

app()
