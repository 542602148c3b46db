"""From two images to the position of the ball: camera, segmentation, moments, triangulation."""
