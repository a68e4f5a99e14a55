"""What all eyes of all worlds see. Begin with one_ray: the others do the same, faster.

one_ray             see: one world, one ray for each receptor
eye_renderer        EyeRenderer: all eyes of all worlds of any scene as one wavefront
prepared_scene      PreparedScene: a model and its eyes, built once for choosing a fidelity and for rendering
ray_kernel          the kernel: lanes, rays, light, depth layers, sums
area_kernel         the same where areas are seen
eye_rays            rays that leave upright eyes, and eyes that may be anywhere
edge_rays           many rays at edges, few elsewhere
light_factors       what the light of each world is multiplied by
labels              Labels: depth, ids and optic flow
optic_flow          motion on the retina
batched_renderer    BatchedRenderer: eyes of the agents in a built-in world
world_scene         WorldScene: such a world, prepared
model_renderer      ModelRenderer: eyes mounted on any MuJoCo model
renderable          which fidelities an eye can have
reference_renderer  ReferenceRenderer: Mitsuba's integrators, slowly
fidelity            Fidelity: how finely, and why
fidelity_choice     cheapest: as little work as noise allows, of what a scene offers
world_fidelity      choose_fidelity: what a built-in world offers
fidelity_stages     its bands, depth layers and light
sample_choice       its rays or areas
fidelity_trials     how their errors are found
random_views        the views that they are tried at
model_fidelity      choose_model_fidelity: what any other model offers, tried at given moments
memory_budget       whether there is memory for it
receptor_noise      noise for all worlds at once
pending_frame       frames that are begun early and waited for late
"""
