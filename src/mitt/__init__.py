"""mitt lets a robot arm catch what is thrown at it."""
