from lockstep.bench.emulator.cli import main

main()
