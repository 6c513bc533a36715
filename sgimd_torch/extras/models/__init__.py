"""Model files of MuJoCo: reading, places, servos, the start posture, and a look before the first movement."""
