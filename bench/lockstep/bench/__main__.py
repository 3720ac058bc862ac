from lockstep.bench.cli import main

main()
