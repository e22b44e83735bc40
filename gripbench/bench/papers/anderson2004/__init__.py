"""Anderson & Bevly (2004): claims run again, figures, the Riccati equation."""
