# Types of what `rhabdom/__init__.py` loads on first use. They stand apart, so that no module here imports a package
# that imports this one.
import evolve as evolve
import optics as optics
import sim as sim

__version__: str
