"""Tests of evolve/report: which test covers which module.

page: test_report_page.py
fitness_section: test_priced_report.py, test_report_page.py
write: test_report_page.py
doing: test_report_page.py
markup: test_markup.py, test_report_page.py
tables: test_report_page.py, test_priced_report.py
lineup: test_lineup.py
agent_figure: test_lineup.py
figures: test_report_page.py, test_priced_report.py
hints: test_hints.py
svg: test_theme.py, test_markup.py, test_report_page.py
theme: test_theme.py
eye_figures: test_eye_figures.py
facet_figures: test_facet_figures.py
views: test_facet_figures.py, test_eye_figures.py
picture: test_picture.py
player: test_player.py
picture_sheet: episodes/test_recorder.py
moving_picture: test_moving_picture.py
replay: episodes/test_episode.py, test_rerun_recording.py, interactive/test_run_products.py
rerun_recording: test_rerun_recording.py, test_rerun_bodies.py
rerun_bodies: test_rerun_bodies.py
rerun_layout: test_rerun_recording.py, test_rerun_bodies.py
rerun_stream: test_rerun_recording.py, test_rerun_bodies.py
exr_export: episodes/test_episode.py, interactive/test_run_products.py
gene_drift: test_gene_drift.py
comparison: cli/test_status_and_compare.py, test_priced_report.py
"""
