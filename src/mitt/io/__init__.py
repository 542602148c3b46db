"""Readers and writers of files: arms, maps, rigs, cells, recordings; whole or not at all."""
