"""Evidence for the errata of a paper and for the settings behind its reproduction."""
