"""Many throws: what a study asks for, who throws, what it comes to."""
