"""The figures of the report, each an SVG: those of the paper, by its numbers, and ours."""
