"""Rooms: features that can be taken away, each with its folder; see `sgimd_torch.rooms`."""
