"""What connects the catcher to the outside: the clock, recordings, maps on disk."""
