"""The command `evolve`.

main         exit codes
arguments    arguments of all commands, and suggestions for what was mistyped
commands     what each command does
output       the one door to the terminal
notes        warnings, each said once
waiting      a bar for every other wait
progress     how a run is going
run_plan     what a run is going to do
pace         how fast this machine is
start_from   starting from an animal of another run
tensorboard  fitness, learning and genes for TensorBoard
doctor       does it work here?
"""
