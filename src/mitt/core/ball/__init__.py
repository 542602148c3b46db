"""From positions of the ball to its motion: flight, motion models, filter."""
