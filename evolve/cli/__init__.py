"""The command `evolve`.

main                  entry point, exit codes, and display of errors
arguments             arguments of all commands, and suggestions for mistyped ones
argument_values       values of arguments: whole numbers within a range
photograph_arguments  arguments of `evolve see`
commands              implementations of the commands
notes                 display of warnings, each of them once
waiting               progress bar for work other than a run
run_plan              predicted steps, hours and disk space of a run
pace                  measurement of the speed of this machine
tensorboard           fitness, learning curves and genes for TensorBoard
doctor                check of the installation
"""
