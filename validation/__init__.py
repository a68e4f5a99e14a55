"""Proofs: scripts that measure, draw a figure and fail if a bound does not hold. Benchmarks only measure.

`evolve validate --list` shows the proofs that proofs.toml names; docs/validation has a page for most of them.

optics      proofs of the optics
sim         proofs of worlds, renderers and environments
evolve      proofs of learning, search and run directories
peers       comparison with other diffraction codes, and with the claims of their tests
mutants     mutation testing: deliberate mistakes and the tests that detect them
benchmarks  times and rates
reference   closed forms and converged quadratures, independent of the packages
pages       shared code of proofs: pages, stored tables and charts
behaviour   hashes of results, to compare two checkouts
"""
