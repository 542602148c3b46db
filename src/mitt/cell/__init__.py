"""A cell as a whole: what its file says made into a catcher, its robot, and its simulation."""
