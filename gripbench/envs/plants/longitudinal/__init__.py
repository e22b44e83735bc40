"""The longitudinal plant of Li, Du & Li (2014), its integrators and its world."""
