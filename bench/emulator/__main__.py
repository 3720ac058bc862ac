from bench.emulator.cli import main

main()
