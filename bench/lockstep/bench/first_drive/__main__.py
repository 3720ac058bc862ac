from lockstep.bench.first_drive.cli import app

app()
