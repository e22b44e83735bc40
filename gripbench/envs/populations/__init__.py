"""Populations: the cars, roads, drives and instruments from which a seed draws."""
