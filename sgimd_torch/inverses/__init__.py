"""Inverse models: which movement should reach a goal? (section 4.4.2, eqs. 8 and 9)"""
