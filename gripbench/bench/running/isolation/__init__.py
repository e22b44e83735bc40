"""Methods that did not ship with gripbench, in confined processes of their own."""
