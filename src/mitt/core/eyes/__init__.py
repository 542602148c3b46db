"""From two images to the position of the ball: segmentation, triangulation, heads."""
