"""What connects the catcher to the outside: the clock, real time, robots."""
