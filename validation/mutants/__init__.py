"""Mutation testing: deliberate mistakes in a copy of the tree, and the tests that detect them.

mutation_testing  proof: share of mutants that the nearest tests kill
named_mutants     mutants that are always tried
mutant_sites      possible mutations of a module
mutant_trials     runs of the nearest tests on each mutant
mutant_plugin     pytest plugin: fast tests first, within a time budget
"""
