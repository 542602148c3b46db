"""Throws: one, its loop, score and log; many; studies."""
