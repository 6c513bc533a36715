"""A check of a robot, and what its outcomes tell of it."""

WORDS = """
command  command  check
hook     hook     remarks=Remarks
"""
PUBLIC = "promises  check_environment"
NEEDS = ("film", "previous", "recordings")
