from lockstep.bench.three_networks.cli import app

app()
