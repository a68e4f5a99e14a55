"""Mistakes made on purpose in a copy of the tree, and the tests that notice them.

mutation_testing  the proof: the share of mutants that the nearest tests kill
named_mutants     mutants that are always tried
mutant_sites      places where a module can be made wrong
mutant_trials     one mutant after another, and what tests make of it
mutant_plugin     a plugin of pytest: quick tests first, within a budget
"""
