"""Li, Du & Li (2014): evidence and figures."""
