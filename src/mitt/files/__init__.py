"""Readers and writers of files: maps, rigs, recordings, whole or not at all."""
