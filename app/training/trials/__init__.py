"""fit on a cluster: each training of a trial is a command of its own."""
