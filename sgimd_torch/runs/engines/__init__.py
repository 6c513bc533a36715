"""Where the runs of a sweep are carried out: in processes of this machine, or on a cluster."""
