"""From positions of the ball to its motion: model of flight, filter, motion models, prediction."""
