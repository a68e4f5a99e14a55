"""Dr.Jit's types in float64, on the requested device. (`drjit.auto` always uses a GPU if there is one.)"""

from optics.numerics.precision import precision

_TYPES = precision("float64")
Float64, TensorXf64, UInt32 = _TYPES.Float64, _TYPES.Tensor64, _TYPES.Index
