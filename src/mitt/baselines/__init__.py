"""Other ways from the ball to joint motion, behind the generator's own call."""
