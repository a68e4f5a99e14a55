"""Reports, replays, comparisons and EXR files.

write            report of a run: one HTML file
doing            progress messages while files are written
page             sections of the report
fitness_section  section on fitness and its parts
tables           tables of the report
lineup           cards of the first and the best animal, with a slider through the generations between them
agent_figure     drawing of an animal's head and eyes
figures          figures of a whole run
eye_figures      figures of one eye's optics
facet_figures    figures of a compound eye's ommatidia
picture_sheet    rendered images of an episode, on a page
views            images at one time of an episode, behind a perfect lens and behind the evolved optics
player           player of an episode on a page
picture          conversion of signals to images
hints            explanations of terms in the report
svg              conversion of figures to SVG in the page's theme
theme            colours of the report
markup           pieces of HTML
comparison       comparison of several runs
gene_drift       comparison of runs with searches with random fitness
moving_picture   episode as a GIF or video
replay           replay of an episode
exr_export       radiance and signals of an agent, as EXR files
rerun_recording  recording of an episode for Rerun
rerun_bodies     bodies of a task's model, and the eyes, for Rerun
rerun_layout     layout in which Rerun opens a recording
rerun_stream     writer of recordings for Rerun
"""
