"""What instruments make of the truth."""
