"""Settings of a run.

run_config     RunConfig: the configuration of a run
settings       sections of RunConfig: default, range and effect of each setting
assemble       RunConfig from all sources; later sources override earlier ones
sources        presets, tasks, files and options as sources of settings
provenance     location of a setting: file and line, or option
checks         type and range checks of single settings
lint           warnings about settings that are allowed but odd
relief_starts  start values of a relief's genes
formats        formats of config.toml, and conversion of former ones
square_eyes    one gene for both sides of an eye
task_choice    TaskChoice: a task, and its code if it may run
task_card      TaskCard: properties of a task that are known without executing it
task_code      TaskCode: source text of a user task
numbering      ids and generations of candidates
tasks/         default settings of the tasks
"""
