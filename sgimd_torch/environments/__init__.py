"""Where learners live: the protocol of an environment, planar arms, and the fishing rod of section 4 in MuJoCo."""
