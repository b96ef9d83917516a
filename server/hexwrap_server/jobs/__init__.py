"""Jobs and where they run: queue, worker processes, what is kept on disk."""
