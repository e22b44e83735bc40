"""Signals of a log in, what is wrong with them and what would mend it out."""
