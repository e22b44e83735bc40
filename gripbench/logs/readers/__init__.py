"""A file of a log in, its columns as they stand in the file out."""
