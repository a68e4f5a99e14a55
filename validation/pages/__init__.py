"""Shared code of proofs: pages, stored tables and charts.

page                  Page: a script's docstring and table as a page in docs/validation
tables                CSV files of measurements
work_precision_chart  chart of error against time, and the colours of all charts
"""
