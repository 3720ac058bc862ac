from lockstep.bench.second_encoding.cli import app

app()
