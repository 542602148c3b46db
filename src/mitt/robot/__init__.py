"""The arm: its description, its two implementations, its limits."""
