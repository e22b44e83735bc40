"""Rows into boards: which runs compare, statistics, ranks."""
