"""What all eyes of all worlds see. Begin with one_ray: the others do the same, faster.

one_ray             see: one world, one ray for each receptor
batched_renderer    BatchedRenderer: one wavefront
wavefront           its kernel, and the poses that it reads
reference_renderer  ReferenceRenderer: Mitsuba's integrators, slowly
fidelity            choose_fidelity, Fidelity: as little work as noise allows
fidelity_trials     a few random views on which that is tried
prepared_scene      PreparedScene: what choosing a fidelity and rendering both begin with
band_error          what a few spectral bands make of measured colours
memory_budget       whether there is memory for it
frozen_kernels      what holds while Dr.Jit records
receptor_noise      noise for all worlds at once
noisy_signals       signals with that noise
pending_frame       frames that are begun early and waited for late
"""
