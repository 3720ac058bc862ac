from lockstep.bench.link_transports.cli import main

main()
