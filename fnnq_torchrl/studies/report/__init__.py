"""The report: one HTML file with the results of a job, a sweep or an experiment."""
