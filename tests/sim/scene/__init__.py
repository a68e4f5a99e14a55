"""Tests of mirrors: which test covers which module. Helpers: oracle, drawn (MuJoCo), models, lit, png.

mirror: test_mirror.py, test_mirror_light.py
source: test_mirror_source.py, test_texture_colors.py
bombs: test_bombs.py
inventory: test_mirror.py
rays: test_mirror.py
cameras: test_mirror.py
pose_snapshot: test_mirror.py
variant: test_mirror.py
shapes: test_mirror.py, test_textures.py
merged_parts: test_mirror.py
tessellation: test_mirror.py, test_cube_textures.py
cube: test_cube_textures.py
surfaces: test_urdf.py, test_textures.py, test_mirror_light.py, test_texture_colors.py
linear_textures: test_texture_colors.py
bsdfs: test_bsdfs.py
coincident: test_coincident.py
model_hash: tracing/test_equal_worlds.py
lights: test_lights.py, test_mirror_light.py
shadowless: test_shadowless.py
sky: test_sky.py
spectra: test_spectra.py
device_arrays: test_frozen_kernels.py
color: test_color.py, exr/test_previews.py
variation: test_variation.py
world_models: envs/test_differing_worlds.py, envs/test_own_models.py
model_settings: envs/test_own_models.py
model_snapshot: test_model_snapshot.py
appearances: envs/test_differing_materials.py
poses: render/test_model_renderer.py
solids: evolve/report/test_rerun_bodies.py
moved_bodies: envs/test_auxiliary.py
primitive_geoms: tracing/test_movers.py
band_error: test_band_error.py, render/test_model_lamps.py
frozen_kernels: test_frozen_kernels.py, render/test_batched_renderer.py
"""
