"""Where a list of runs is carried out: in processes of this machine, or on a cluster; ``loop`` is the same for both."""
