"""The live side: the loop of a cell, its robot, its cameras."""
