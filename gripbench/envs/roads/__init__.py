"""Roads and the paths on them."""
