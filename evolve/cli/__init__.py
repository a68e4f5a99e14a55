"""The command `evolve`.

main         exit codes
arguments    arguments of all commands, and suggestions for what was mistyped
commands     what each command does
notes        warnings, each said once
waiting      a bar for every other wait
run_plan     what a run is going to do
pace         how fast this machine is
tensorboard  fitness, learning and genes for TensorBoard
doctor       does it work here?
"""
