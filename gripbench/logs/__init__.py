"""Logs of real vehicles: read, map to the signal table, judge, and keep as recordings."""
