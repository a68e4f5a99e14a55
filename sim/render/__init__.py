"""Rendering of all eyes in all worlds. Read one_ray first: the batched renderers compute the same values faster.

one_ray             see: one world, one ray for each receptor
eye_renderer        EyeRenderer: all eyes of all worlds of any scene, rendered together
prepared_scene      PreparedScene: a model and its eyes, built once for choosing a fidelity and for rendering
ray_kernel          kernel that traces one ray per lane (parallel computation) and sums the light for each receptor
area_kernel         kernel that computes the mean light in areas, rectangles of the visual field
eye_rays            rays of upright eyes, and of eyes that may be anywhere
edge_rays           adaptive edge sampling: many rays at edges, few in other places
light_factors       factors by which the light of each world is multiplied
labels              Labels: depth, ids and optic flow
optic_flow          motion on the retina
batched_renderer    BatchedRenderer: eyes of the agents in a built-in world
world_scene         WorldScene: a built-in world, prepared
model_renderer      ModelRenderer: eyes mounted on any MuJoCo model
renderable          check that a fidelity fits an eye
reference_renderer  ReferenceRenderer: Mitsuba's integrators, slow
fidelity            Fidelity: how finely to render (samples, bands, depth layers and light), and the reasons
fidelity_choice     cheapest: the cheapest fidelity whose error is small compared with receptor noise
world_fidelity      choose_fidelity: fidelity of a built-in world
fidelity_stages     choice of bands, depth layers and light for a built-in world
sample_choice       choice of rays or areas for a built-in world, and of their number
fidelity_trials     trials that measure the errors of fidelities in a built-in world
populations         views and receptors for which the errors of trials are computed
random_views        random views for the trials
model_fidelity      choose_model_fidelity: fidelity of any other model, from trials at given poses
memory_budget       check of the memory that rendering needs
receptors_in_time    ReceptorsInTime: filters, adaptation, events and motion detectors
receptor_noise      noise for all worlds at once
pending_frame       frames that are launched early and read late
"""
