"""What proofs share: their pages, stored tables and charts.

page                  Page: a script's docstring and table, printed, drawn and written into docs/validation
tables                CSV files of measurements
work_precision_chart  error against time, and the colours of all charts
"""
