"""One module per task: its world's geometry (`add_layout`)."""
