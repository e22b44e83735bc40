"""Estimates and truth into scores."""
