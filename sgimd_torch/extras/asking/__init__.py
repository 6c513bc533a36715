"""Learners that ask teachers for demonstrations: SGIM-IM and SGIM-ACTS."""

WORDS = """
algorithm  algorithms  sgim-im sgim-im-search sgim-acts sgim-acts-search
goals      interest    strategic=StrategicInterest
teachers   teachers    all=AnsweringTeacher demonstrator-1 demonstrator-2 demonstrator-3
teachers   teachers    low-half=low_half_teacher high-half=high_half_teacher
hook       hook        teachers=Asked
"""
PUBLIC = """
algorithms  sgim_acts sgim_im
teachers    AnsweringTeacher high_half low_half
"""
