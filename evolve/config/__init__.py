"""Settings of a run.

run_config     RunConfig: the configuration of a run
settings       sections of RunConfig: default, range and effect of each setting
assemble       RunConfig assembled from all sources of settings; later sources override earlier ones
sources        sources of settings: presets, tasks, files and options
provenance     location of a setting: file and line, or command-line option
costs          CostsConfig: prices of eyes and brains, and the costs of an animal
checks         type and range checks of single settings
eye_checks     checks of the settings of eyes
layout_checks  checks of the settings of layouts
lint           warnings about settings that are allowed but odd
relief_starts  start values for the genes of a pupil's relief
formats        formats of config.toml, and conversion of older ones
square_eyes    settings of square eyes, which have one gene for height and width
task_choice    TaskChoice: a task, with its code if the user has named the task
task_card      TaskCard: properties of a task that are known without executing it
task_code      TaskCode: source text of a user task
task_errors    method, line and file of an error in the code of a user task
numbering      conversion between a candidate's id and its generation
tasks/         default settings of the tasks
"""
