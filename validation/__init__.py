"""Proofs: scripts that measure, draw a figure and fail where a bound does not hold. Benchmarks only measure.

`evolve validate --list` shows the proofs that proofs.toml names; docs/validation has a page for most of them.

optics      proofs of the optics
sim         proofs of worlds, renderers and environments
evolve      proofs of learning, search and run directories
peers       comparison with other diffraction codes, and with what their tests assert
mutants     mistakes made on purpose, and the tests that notice them
benchmarks  times and rates
reference   closed forms and converged quadratures, which import none of the packages
pages       what proofs share: their pages, stored tables and charts
behaviour   hashes of results, to compare two checkouts
"""
