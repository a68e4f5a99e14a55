"""Settings of a run.

run_config     RunConfig
settings       its sections: every setting, its range, what it does
assemble       all sources put together, later ones winning
sources        presets, tasks, files and options
provenance     where a setting stands
checks         one line that says what would be right
lint           what is odd, though nothing forbids it
relief_starts  where the genes of a relief start
formats        formats of config.toml, and how former ones are read
square_eyes    one gene for both sides of an eye
task_choice    TaskChoice: which task, and its code if it may run
task_card      TaskCard: what is known of a task without executing it
task_code      TaskCode: a user's task, as text
numbering      which id belongs to which generation
tasks/         what a task sets unless a run says otherwise
"""
