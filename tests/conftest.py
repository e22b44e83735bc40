"""Settings of all tests."""

from hypothesis import settings

# An example that compiles a kernel, or a busy machine, says nothing about the property.
settings.register_profile("gripbench", deadline=None, max_examples=60)
settings.load_profile("gripbench")
