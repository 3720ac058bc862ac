from lockstep.bench.robot_cuts.cli import app

app()
