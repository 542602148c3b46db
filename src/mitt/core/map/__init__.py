"""The paper's map from the ball's position to the desired joints, and its learning."""
