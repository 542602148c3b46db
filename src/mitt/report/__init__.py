"""What a run and a study look like: pages, figures, replays."""
