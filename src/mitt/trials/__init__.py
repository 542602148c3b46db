"""One throw: the loop, its score, its log; and a run of throws."""
