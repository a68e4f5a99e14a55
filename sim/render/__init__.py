"""What all eyes of all worlds see. Begin with one_ray: the others do the same, faster.

one_ray             see: one world, one ray for each receptor
batched_renderer    BatchedRenderer: one wavefront
wavefront           its kernel, and the poses that it reads
area_wavefront      its kernels where areas are seen
reference_renderer  ReferenceRenderer: Mitsuba's integrators, slowly
fidelity            Fidelity: how finely, and why
fidelity_choice     choose_fidelity: as little work as noise allows
fidelity_stages     how that is chosen for bands, depth layers and light
sample_choice       and for rays or areas
fidelity_trials     trials of what was not chosen yet
random_views        the views that they look through
prepared_scene      PreparedScene: what choosing a fidelity and rendering both begin with
memory_budget       whether there is memory for it
receptor_noise      noise for all worlds at once
pending_frame       frames that are begun early and waited for late
model_renderer      ModelRenderer: eyes mounted on any MuJoCo model
model_wavefront     its kernels
model_fidelity      how many rays they need
edge_rays           many rays at edges, few elsewhere
renderable          what eyes on a model may be
optic_flow          motion on the retina
"""
