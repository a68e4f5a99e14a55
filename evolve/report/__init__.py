"""What people look at: reports, replays, comparisons, EXR files.

write            the report of a run: one HTML file
doing            telling who waits what is being made
page             its sections
tables           its numbers
lineup           first and best animal, and those between
agent_figure     an animal's head and eyes
figures          figures of a whole run
eye_figures      figures of one eye's optics
picture_sheet    pictures of an episode, on a page
views            one moment, through a perfect lens and through the evolved one
player           an episode to play
picture          signals as pictures
hints            what its words mean
svg              figures that follow the page's theme
theme            its colours
markup           pieces of HTML
comparison       runs side by side
gene_drift       runs beside the null model of their search
moving_picture   an episode as a GIF or film
replay           an episode once more
exr_export       what an agent saw, as EXR files
rerun_recording  an episode for rerun
rerun_bodies     a task's model, for rerun
rerun_layout     what a recording opens with
rerun_stream     what these are written with
"""
