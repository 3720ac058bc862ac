from lockstep.emulator.cli import main

main()
