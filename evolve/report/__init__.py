"""Reports, replays, comparisons and EXR files.

write            report of a run: one HTML file
doing            progress messages
page             sections of the report
tables           tables of the report
lineup           first and best animal, with the best of each generation between them
agent_figure     drawing of an animal's head and eyes
figures          figures of a whole run
eye_figures      figures of one eye's optics
picture_sheet    rendered images of an episode, on a page
views            images of one moment behind a perfect lens and behind the evolved optics
player           episode that a page plays
picture          signals as images
hints            explanations of terms in the report
svg              figures that follow the page's theme
theme            colours of the report
markup           pieces of HTML
comparison       comparison of several runs
gene_drift       comparison of runs with the null model of their search
moving_picture   episode as a GIF or video
replay           replay of an episode
exr_export       radiance and signals of an agent, as EXR files
rerun_recording  recording of an episode for rerun
rerun_bodies     bodies of a task's model, for rerun
rerun_layout     layout in which rerun opens a recording
rerun_stream     writer of recordings for rerun
"""
