"""From the desired joint motion to torques and fingers, within every limit."""
