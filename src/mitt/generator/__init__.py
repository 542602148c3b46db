"""The map from the ball's position to the desired joints, its learning and its adaptation."""
