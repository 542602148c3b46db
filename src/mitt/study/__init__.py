"""Trials, their scores, and what is made of them."""
