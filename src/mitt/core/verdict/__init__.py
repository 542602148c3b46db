"""What is known before moving: whether a ball can be met, held, and how hard it hits."""
