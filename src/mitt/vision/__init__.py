"""From two images to the motion of the ball: camera, moments, triangulation, filter."""
