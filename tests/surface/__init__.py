"""Everything public, right values for all of it, and wrong ones."""
