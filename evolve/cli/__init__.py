"""The command `evolve`.

main         entry point, and exit codes
arguments    arguments of all commands, and suggestions for mistyped ones
commands     implementations of the commands
notes        warnings, each shown once
waiting      progress bar for waits other than a run
run_plan     predicted steps, hours and disk space of a run
pace         measured speed of this machine
tensorboard  fitness, learning and genes for TensorBoard
doctor       check of the installation
"""
