"""Settings of a run.

run_config     RunConfig
sections       its sections: every setting, its range, what it does
assemble       presets, files and options put together
provenance     where a setting stands
checks         one line that says what would be right
lint           what is odd, though nothing forbids it
relief_starts  where the genes of a relief start
"""
