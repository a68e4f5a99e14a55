"""What the commands of `evolve` do; one module per kind, loaded by `evolve.cli` on use."""
