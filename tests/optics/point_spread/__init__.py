"""Tests that fail when a module of optics/point_spread is broken.

arriving: test_arriving_parts.py, test_light_parts.py, test_arriving.py, test_measure_bounds.py
batch: test_attempt_parts.py, test_light_parts.py, test_batch.py
lens_mtf: test_light_parts.py, test_lens_mtf.py
circle_sums: test_circle_sums.py
concentration: test_attempt_parts.py, test_check_parts.py, test_measures.py, test_measure_errors.py
strehl: test_peaks.py, test_measures.py, test_measure_errors.py, test_measure_bounds.py
window_loss: test_loss_parts.py, test_light_parts.py, test_measure_bounds.py
light_batch: test_light_parts.py, test_torch.py
coarse_stack: test_torch_stacks.py
microvilli: test_microvilli.py
converging: test_converging_parts.py, test_vector_focus.py, test_microvilli.py
disk_sum: test_loss_parts.py, test_check_parts.py, test_microvilli.py
modulation_transfer: test_contrast_parts.py, test_modulation_transfer.py
contrast: test_contrast_parts.py, test_measures.py, test_measure_errors.py, test_modulation_transfer.py
mixture: test_mixture.py
pictures: test_attempt_parts.py, test_check_parts.py, test_pictures.py
planner: test_planner_parts.py, test_cost_formulas.py, test_planner.py
population: test_common_plans.py, test_population_parts.py, test_population.py, test_population_members.py
population_members: test_population_parts.py, test_population_members.py
psf: test_psf.py, test_field.py, test_derivatives.py, test_robustness.py
request: test_check_parts.py, test_cost_formulas.py, test_request.py, test_psf.py
psf_result: test_psf_result.py, test_psf.py, test_measure_errors.py
spot_check: test_spot_parts.py, test_check_parts.py, test_spot_check.py
through_focus: test_attempt_parts.py, test_through_focus.py
vector_focus: test_loss_parts.py, test_vector_focus.py, test_foci.py
window_cost: test_cost_formulas.py, test_window_cost.py, test_predicted_cost.py
white: test_white_parts.py, test_white.py
"""
