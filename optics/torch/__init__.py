"""PSFs and images inside a PyTorch graph. Gradients flow from a loss back to every tensor in the pupil.

psf(pupil, wavelengths, sensor_distance, ...)     PSFs of one or several pupils, as a tensor
camera_image(scene, pupil, sensor, ...)           electrons in the pixels of a camera
PointSpread(radius, wavelengths, ...)             module with a learnable relief

heights = torch.zeros(32, 32, dtype=torch.float64, requires_grad=True)    # [m]
pupil = optics.Pupil(30e-6, optics.HeightMap(heights), thin_lens_focal_length=240e-6)
psf = optics.torch.psf(pupil, 550e-9, 240e-6, dx=1e-6, shape=(33, 33))    # tensor (wavelength, y, x)
loss(psf).backward()                                                      # fills heights.grad

tensor_psf      psf
tensor_camera   camera_image
learnt_relief   PointSpread
former_calls    former arguments of psf
autograd        functions of Dr.Jit arrays as operations of PyTorch
"""

from optics.torch.learnt_relief import PointSpread
from optics.torch.tensor_camera import camera_image
from optics.torch.tensor_psf import psf

__all__ = ["PointSpread", "camera_image", "psf"]
