"""A robot that changes: it is noticed, and what still helps is kept; movements of another robot to begin with."""

WORDS = """
watch  watcher  changes
hook   hook     begin-with=BeginWith
"""
PUBLIC = "watcher  changes"
