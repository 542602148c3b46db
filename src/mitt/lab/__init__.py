"""The laboratory: simulated worlds, trials, studies, rivals, designs, reports."""
