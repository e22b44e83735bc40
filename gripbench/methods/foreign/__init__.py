"""Methods whose mathematics is not Python: a shared library, a program."""
