"""Drivers and the profiles that they follow."""
