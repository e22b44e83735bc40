"""The planar plant of four wheels, its run, its truth and its world."""
