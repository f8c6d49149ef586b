"""How realisations are computed: chunks, tasks, workers, checkpoints, progress."""
