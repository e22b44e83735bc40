"""The report: one HTML file with everything that was run, which opens from disk."""
