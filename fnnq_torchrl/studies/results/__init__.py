"""The results of any jobs, as a table and as a pandas frame."""
