"""What the commands of `evolve` do; one module per kind, loaded by `evolve.cli.main` on use."""

INTERRUPTED = 130  # exit code after Ctrl-C, as shells count it
